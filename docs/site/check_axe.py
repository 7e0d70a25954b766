"""Whether axe-core finds faults of accessibility in a built site, whether a page is wider than the window, at 1440 and 390
pixels, light and dark, and whether searches find their page: in Debian's Chromium.

Usage: check_axe.py FOLDER AXE [--all | PAGE...]    AXE is axe.min.js. Without pages, one or two of each kind; all take 10 minutes
Exits with 1 and a line for each fault, with 77 without Chromium or selenium.
"""

import functools
import http.server
import pathlib
import sys
import threading
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/page"))
sys.path.insert(0, str(ROOT / "tests/support"))
SIZES = ((1440, 900), (390, 844))
SAMPLES = [f"docs/{name}" for name in (  # cards, tables, tabs, code, pictures, formulas, signatures
    "index", "guides", "terms", "benchmarks", "gallery", "mathematics", "learn/first-lcqp", "notebooks/session",
    "guides/from-gurobi", "reference/python/Session", "reference/cpp/options", "reference/cpp/jobs",
    "reference/typescript/Client", "reference/proto/service", "reference/http")] + ["search", "core/OPTIONS"]
SEARCHES = {"portfolio cardinality": "docs/learn/portfolio.html", "M-stationary": "docs/mathematics.html"}
FIRST = 3  # a page must be among so many results
# Colours change at once: a page is not measured on its way from light to dark.
STILL = """const style = document.createElement("style");
style.textContent = "*, *::before, *::after { transition: none !important; animation: none !important; }";
document.head.append(style);"""
RESULTS = """const area = document.querySelector("#search-results");
if (!area?.querySelector("h2") || /Searching|Preparing/.test(area.textContent)) return null;
return [...area.querySelectorAll("li > a")].map((link) => link.getAttribute("href").replace(/#.*/, ""));"""
AXE = """const done = arguments[1];
axe.run(arguments[0] ? document : {exclude: [".sidebar-tree"]}, {resultTypes: ["violations"], preload: false})
  .then((found) => done(found.violations));"""
PATIENCE_S = 120  # for one run of axe, beside a busy machine's other work


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def searches(browser, address):
    """A line for each search whose page is not among the first results, or whose result does not lead there."""
    for words, page in SEARCHES.items():
        browser.open(f"{address}/search.html?q={urllib.parse.quote(words)}")
        browser.wait(f"return (() => {{ {RESULTS} }})() !== null")
        found = browser.run(RESULTS)
        if page not in found[:FIRST]:
            yield f"search for {words!r}: {page} is not among the first {FIRST} of {len(found)} results: {found[:FIRST]}"
            continue
        browser.all("#search-results li > a")[found.index(page)].click()
        browser.wait("return document.readyState === 'complete' && !location.pathname.endsWith('search.html')")
        if not browser.driver.current_url.partition("?")[0].partition("#")[0].endswith(page):
            yield f"search for {words!r}: the result leads to {browser.driver.current_url}"


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
        browser.run(STILL)
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
    if not wanted:
        for line in searches(browser, f"http://127.0.0.1:{server.server_port}"):
            count += 1
            print(line, flush=True)
    browser.close()
    print(f"{len(pages)} pages, {runs} runs of axe, {0 if wanted else len(SEARCHES)} searches, {count} faults")
    sys.exit(1 if count else 0)


main()
