"""Whether each link of a built site leads to a file and a fragment that are there, each page is light, each picture has a
text, and each list of definitions is whole.

Usage: check_links.py FOLDER    exits with 1 and a line for each fault
"""

import html.parser
import pathlib
import sys
import urllib.parse

PAGE_BYTES = 500_000  # with its scripts and styles, without pictures; search.html loads the index of all words


class Page(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.fragments, self.links, self.loaded, self.faults = set(), [], [], []
        self.lists = []  # of each open dl, the last one of its dt and dd
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.fragments |= {given.get("id"), given.get("name") if tag == "a" else None}
        if tag == "img" and "alt" not in given:
            self.faults.append(f"a picture without a text: {given.get('src')}")
        if tag == "dl":
            self.lists.append("")
        elif tag in ("dt", "dd") and self.lists:
            self.lists[-1] = tag
        link = given.get("href") or given.get("src")
        if link and not urllib.parse.urlsplit(link).scheme:
            self.links.append(link)
            if tag == "script" or (tag == "link" and "stylesheet" in given.get("rel", "")):
                self.loaded.append(link)


    def handle_endtag(self, tag):
        if tag == "dl" and self.lists and self.lists.pop() != "dd":
            self.faults.append(f"line {self.getpos()[0]}: a list of definitions that does not end with one")


def target(path, link):
    parts = urllib.parse.urlsplit(link)
    return (path.parent / urllib.parse.unquote(parts.path)).resolve() if parts.path else path, urllib.parse.unquote(parts.fragment)


def main():
    folder = pathlib.Path(sys.argv[1]).resolve()
    pages = {path: Page(path) for path in folder.rglob("*.html") if "_static" not in path.parts}
    faults, count = [], 0
    for path, page in sorted(pages.items()):
        faults += [f"{path.relative_to(folder)}: {fault}" for fault in page.faults]
        for link in dict.fromkeys(page.links):
            count += 1
            there, fragment = target(path, link)
            if not there.is_file():
                faults.append(f"{path.relative_to(folder)}: links to {link}, which is not there")
            elif fragment and there in pages and fragment not in pages[there].fragments:
                faults.append(f"{path.relative_to(folder)}: links to {link}, but there is no such fragment")
        files = [path, *{target(path, link)[0] for link in page.loaded}]
        size = sum(file.stat().st_size for file in files if file.is_file())
        if size > PAGE_BYTES and path.name != "search.html":
            faults.append(f"{path.relative_to(folder)}: has {size} bytes with scripts and styles, more than {PAGE_BYTES}")
    print("\n".join([*faults, f"{len(pages)} pages, {count} links, {len(faults)} faults"]))
    sys.exit(1 if faults or not pages else 0)


main()
