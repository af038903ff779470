"""Opens the page in headless Chromium, lets its script implant five seeds, and compares the debrief with
`host-ui procedure` over `rt-core --no-rt`.

Usage: check.py SITE PROGRAMS RECORDING PICTURES. Serves the folder SITE, takes rt-core and host-ui from the folder
PROGRAMS, drops the file RECORDING onto the page, and writes screenshots of each size into the folder PICTURES. Fails if
the page asks another host, reports an error, does not show the recording, or if a seed lies elsewhere. Chromium draws
on the processor.
"""

import base64
import functools
import http.server
import json
import pathlib
import shutil
import subprocess
import sys
import threading
import time

from playwright.sync_api import sync_playwright

# Sizes of the window, each with the places of *Run steps 2 to 6* and of *Save the debrief*.
SIZES = [
    ((1366, 768), (142, 116), (74, 397)),
    ((1920, 1080), (178, 137), (92, 489)),
    ((800, 1100), (142, 165), (74, 446)),
]
DRAWN_ON_PROCESSOR = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
LOADED_WITHIN_MS = 120_000
SCRIPT_MS, IMPLANTED_WITHIN_S = 40_000, 120
COUNTED_MS, SHOWN_MS = 5_000, 10_000
# The script looks once a frame, and the tissue creeps while the needle waits for it: seeds of two runs of host-ui
# procedure lie 0.04 mm apart.
AGREES_MM, AGREES_N = 0.2, 0.05
FRAMES = """(ms) => new Promise((done) => {
  const begun = performance.now(); let frames = 0;
  const frame = (now) => { frames += 1; now - begun < ms ? requestAnimationFrame(frame) : done(frames * 1000 / (now - begun)); };
  requestAnimationFrame(frame);
})"""

DROP = """([name, bytes]) => {
  const content = Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0));
  const transfer = new DataTransfer();
  transfer.items.add(new File([content], name));
  const canvas = document.getElementById("window");
  for (const kind of ["dragover", "drop"])
    canvas.dispatchEvent(new DragEvent(kind, { dataTransfer: transfer, bubbles: true, cancelable: true }));
}"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    """Serves files without a line for each."""

    def log_message(self, *_):
        pass


def procedure(programs, folder):
    """Returns the result of the same needle without a page."""
    instance = f"page-check-{folder.stat().st_ino}"
    core = subprocess.Popen([programs / "rt-core", "--no-rt", "--instance", instance])
    try:
        out = folder / "procedure"
        shutil.rmtree(out, ignore_errors=True)
        command = [programs / "host-ui", "procedure", "--instance", instance, "--out", out]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return json.loads((out / "result.json").read_text())
    finally:
        core.terminate()
        core.wait()


def debrief(page, save):
    """Returns the score that the page downloads, `None` if there is nothing to save yet."""
    files = []
    take = lambda file: files.append(file)
    page.on("download", take)
    page.mouse.click(*save)
    page.wait_for_timeout(5_000)
    page.remove_listener("download", take)
    for file in files:
        if file.suggested_filename == "score.json":
            return json.loads(pathlib.Path(file.path()).read_text())
    return None


def implant(page, run, save):
    """Runs the script, and returns the debrief after it, and the frames a second meanwhile."""
    page.mouse.click(*run)
    page.wait_for_timeout(2_000)
    frames_hz = page.evaluate(FRAMES, COUNTED_MS)
    # The button of the debrief comes with the last step; other steps have others at its place.
    page.wait_for_timeout(SCRIPT_MS)
    until = time.monotonic() + IMPLANTED_WITHIN_S
    before = None
    while time.monotonic() < until:
        score = debrief(page, save)
        # The last figures stand still: the tissue is at rest.
        if score and before and score["seeds"] == before["seeds"] and len(score["seeds"]) == 5:
            return score, frames_hz
        before = score
    return None, frames_hz


def compare(score, result, name):
    """Returns what differs between the debrief of the page and the procedure."""
    if score is None:
        return [f"{name}: the page has no debrief of five seeds"]
    problems = []
    for number, (seed, wanted) in enumerate(zip(score["seeds"], result["seeds"]), 1):
        off_mm = [seed["error_along_mm"] - wanted["error_along_mm"], seed["error_across_mm"] - wanted["error_across_mm"]]
        print(f"{name}: seed {number}: {seed['error_mm']:.3f} mm off plan, {off_mm[0]:+.3f} along, {off_mm[1]:+.3f} across the procedure's")
        problems += [f"{name}: seed {number} lies elsewhere"] * (max(map(abs, off_mm)) > AGREES_MM)
    peak_n, wanted_n = score["motion"]["peak_force_n"], result["force"]["peak_n"]
    print(f"{name}: peak force {peak_n:.3f} N, of the procedure {wanted_n:.3f} N")
    return problems + [f"{name}: another peak force"] * (abs(peak_n - wanted_n) > AGREES_N)


def check(browser, address, recording, pictures, result, size):
    """Returns the problems of one visit in one size."""
    problems = []
    (width, height), run, save = size
    name = f"{width}x{height}"
    page = browser.new_page(viewport={"width": width, "height": height})
    # Without a graphics card Chromium itself says that WebGPU has none; the window then draws by WebGL.
    is_ours = lambda line: line.type in ("error", "warning") and line.text != "No available adapters."
    page.on("console", lambda line: is_ours(line) and problems.append(f"console: {line.text}"))
    page.on("pageerror", lambda why: problems.append(f"error: {why}"))
    page.on("request", lambda asked: asked.url.startswith((address, "data:", "blob:")) or problems.append(f"asks {asked.url}"))
    if not page.goto(address).ok or page.query_selector("#window") is None:
        return [f"{address} is not the page"]
    page.wait_for_selector("#waiting", state="detached", timeout=LOADED_WITHIN_MS)
    loaded_s = page.evaluate("performance.now()") / 1000
    # The line of the needle is solved, and its badge drawn.
    page.wait_for_timeout(5_000)
    page.screenshot(path=pictures / f"{name}.png")
    rest_hz = page.evaluate(FRAMES, COUNTED_MS)
    score, frames_hz = implant(page, run, save)
    page.screenshot(path=pictures / f"{name}-implanted.png")
    print(f"{name}: open after {loaded_s:.1f} s, {rest_hz:.1f} frames/s at rest, {frames_hz:.1f} while the needle moves")
    problems += compare(score, result, name)
    # The keys: force off, so that a recording may replace the core.
    page.keyboard.press("d")
    page.wait_for_timeout(1_000)
    page.evaluate(DROP, [recording.name, base64.b64encode(recording.read_bytes()).decode()])
    page.wait_for_timeout(SHOWN_MS)
    if not page.title().startswith(recording.name):
        problems.append(f"{name}: the dropped recording is not shown")
    page.screenshot(path=pictures / f"{name}-dropped.png")
    page.close()
    return problems


def main():
    site, programs, recording, pictures = map(pathlib.Path, sys.argv[1:])
    pictures.mkdir(parents=True, exist_ok=True)
    result = procedure(programs, pictures)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_port}/"
    problems = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=DRAWN_ON_PROCESSOR)
        for size in SIZES:
            problems += check(browser, address, recording, pictures, result, size)
        browser.close()
    print("\n".join(problems) or "no problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
