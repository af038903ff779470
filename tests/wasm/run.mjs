// Repeats a flight recording in wasm, or without one measures a tick: node run.mjs MODULE.wasm [FILE.flight]
import { readFileSync } from "node:fs";

const RUNS = 5;
const [modulePath, flightPath] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(readFileSync(modulePath), {});
const core = instance.exports;
const text = () => Buffer.from(core.memory.buffer, core.text(), core.text_len()).toString();

function guarded(work) {
    try {
        return work();
    } catch (why) {
        console.error(text());
        throw why;
    }
}

if (flightPath) {
    const flight = readFileSync(flightPath);
    const at = core.room(flight.length);
    new Uint8Array(core.memory.buffer, at, flight.length).set(flight);
    process.exitCode = guarded(() => core.repeat_input()) ? 0 : 1;
    process.stdout.write(text());
} else {
    core.room(0);
    // ChainMail as the paper prints it, and with needle lines: the places of both among the kinds of tissue.
    for (const tissue of [2, 0]) {
        guarded(() => core.prepare(tissue));
        const name = text();
        let least = Infinity;
        for (let run = 0; run < RUNS; run++) {
            // Processor time: other programs may keep this one waiting.
            const begun = process.cpuUsage();
            const ticks = guarded(() => core.rehearse());
            const used = process.cpuUsage(begun);
            least = Math.min(least, (used.user + used.system) / ticks);
        }
        console.log(`${name}: ${least.toFixed(1)} µs a force tick with its share of the tissue`);
    }
}
