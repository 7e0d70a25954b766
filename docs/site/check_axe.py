"""Whether axe-core finds faults of accessibility in a built site, and whether a page is wider than the window: at 1440 and
390 pixels, light and dark, in Debian's Chromium.

Usage: check_axe.py FOLDER AXE [--all | PAGE...]    AXE is axe.min.js. Without pages, some that stand for the others
Exits with 1 and a line for each fault, with 77 without Chromium or selenium.
"""

import functools
import http.server
import pathlib
import sys
import threading

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/page"))
sys.path.insert(0, str(ROOT / "tests/support"))
SIZES = ((1440, 900), (390, 844))
SAMPLES = [f"docs/{name}" for name in (
    "index", "guides", "terms", "learn/first-lcqp", "guides/from-gurobi", "reference/python/Session",
    "reference/cpp/options")] + ["search", "core/OPTIONS"]  # cards, tabs, code, tables, signatures
AXE = """const done = arguments[1];
axe.run(arguments[0] ? document : {exclude: [".sidebar-tree"]}, {resultTypes: ["violations"], preload: false})
  .then((found) => done(found.violations));"""
PATIENCE_S = 120  # for one run of axe, beside a busy machine's other work


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def main():
    folder, axe = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    try:
        from browser import Browser
        browser = Browser()
    except (ImportError, OSError) as error:
        print(f"skipped: no Chromium or no selenium: {error}")
        sys.exit(77)
    browser.driver.set_script_timeout(PATIENCE_S)
    wanted = sys.argv[3:]
    pages = [f"{name}.html" for name in SAMPLES] if not wanted else wanted if wanted != ["--all"] else sorted(
        path.relative_to(folder).as_posix() for path in folder.rglob("*.html") if "_static" not in path.parts)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    script, count, runs = axe.read_text(encoding="utf-8"), 0, 0
    for at, page in enumerate(pages):
        if page == "index.html":
            continue  # redirects
        browser.open(f"http://127.0.0.1:{server.server_port}/{page}")
        browser.run(script)
        for kind in range(4):
            width, height = SIZES[kind % 2]
            scheme = ("light", "dark")[kind // 2]
            if not wanted and at % 2 != (kind % 2 ^ kind // 2):
                continue  # each page wide and narrow, light and dark, and all four in turn
            browser.size(width, height)
            browser.scheme(scheme)
            runs += 1
            where = f"{page}, {width} px, {scheme}"
            needs = browser.run("return document.documentElement.scrollWidth")
            faults = [f"{where}: is {needs} px wide"] if needs > width else []
            for fault in browser.driver.execute_async_script(AXE, page == "docs/index.html"):  # all have its navigation
                faults.append(f"{where}: {fault['impact']}: {fault['id']}: {fault['nodes'][0]['target']} "
                              f"({len(fault['nodes'])}): {fault['nodes'][0]['failureSummary']!r}"[:400])
            count += len(faults)
            for line in faults:
                print(line, flush=True)
    browser.close()
    print(f"{len(pages)} pages, {runs} runs of axe, {count} faults")
    sys.exit(1 if count else 0)


main()
