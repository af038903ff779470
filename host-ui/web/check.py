"""Opens the page in headless Chromium: does it load, ask no other host, report no error, and play what is dropped on it?

Usage: check.py SITE RECORDING PICTURES. Serves the folder SITE, drops the file RECORDING onto the page, and writes a
screenshot in each size into the folder PICTURES. Chromium draws on the processor.
"""

import base64
import functools
import http.server
import pathlib
import shutil
import sys
import threading

from playwright.sync_api import sync_playwright

SIZES = [(1366, 768), (1920, 1080), (800, 1100)]
DRAWN_ON_PROCESSOR = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
LOADED_WITHIN_MS = 120_000
# Time for the example to get into the tissue, and time over which frames are counted.
PLAYED_MS, COUNTED_MS = 6_000, 5_000

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


def check(browser, address, recording, pictures, size):
    """Returns the problems of one visit in one size."""
    problems = []
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    # Without a graphics card Chromium itself says that WebGPU has none; the window then draws by WebGL.
    is_ours = lambda line: line.type in ("error", "warning") and line.text != "No available adapters."
    page.on("console", lambda line: is_ours(line) and problems.append(f"console: {line.text}"))
    page.on("pageerror", lambda why: problems.append(f"error: {why}"))
    page.on("request", lambda asked: asked.url.startswith((address, "data:", "blob:")) or problems.append(f"asks {asked.url}"))
    if not page.goto(address).ok or page.query_selector("#window") is None:
        return [f"{address} is not the page"]
    page.wait_for_selector("#waiting", state="detached", timeout=LOADED_WITHIN_MS)
    loaded_s = page.evaluate("performance.now()") / 1000
    page.wait_for_function("document.title.startsWith('Example')", timeout=LOADED_WITHIN_MS)
    page.wait_for_timeout(PLAYED_MS)
    frames_hz = page.evaluate(FRAMES, COUNTED_MS)
    name = f"{size[0]}x{size[1]}"
    page.screenshot(path=pictures / f"{name}.png")
    print(f"{name}: open after {loaded_s:.1f} s, {frames_hz:.1f} frames/s")
    page.evaluate(DROP, [recording.name, base64.b64encode(recording.read_bytes()).decode()])
    try:
        page.wait_for_function(f"document.title.startsWith('{recording.name}')", timeout=LOADED_WITHIN_MS)
    except Exception:
        problems.append("the dropped recording is not shown")
    page.wait_for_timeout(1_000)
    page.screenshot(path=pictures / f"{name}-dropped.png")
    page.close()
    return problems


def main():
    site, recording, pictures = map(pathlib.Path, sys.argv[1:])
    pictures.mkdir(parents=True, exist_ok=True)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_port}/"
    problems = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=DRAWN_ON_PROCESSOR)
        for size in SIZES:
            problems += check(browser, address, recording, pictures, size)
        browser.close()
    print("\n".join(problems) or "no problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
