"""Lays out the folder from which Sphinx builds the site: all pages and pictures of the repository at their own paths,
the pictures that the code of docs/learn, docs/guides and docs/gallery.md draws, the notebooks with what they show, and the
pages of the reference that are made of tables and programs.

Usage: stage.py FOLDER BUILD_DIR    makes FOLDER/source or brings it up to date; BUILD_DIR has the programs and marble
"""

import hashlib
import pathlib
import re
import shutil
import subprocess
import sys

import benchmarks
import pages
import reference

ROOT = pathlib.Path(__file__).resolve().parents[2]
SITE = ROOT / "docs/site"
MISSING = 77  # the exit code of what lacks a package
DRAWS = re.compile(r"\.save(fig)?\(")
PARTS = ("*.md", "docs/notebooks/*.ipynb", "*.svg", "*.png", "docs/_static/*", "docs/_templates/*")


def copy(source, target):
    """With its time, so that Sphinx reads again only what has changed."""
    if not target.exists() or target.stat().st_mtime != source.stat().st_mtime:
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)


def committed():
    listing = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard", *PARTS], cwd=ROOT,
                             capture_output=True, text=True, check=True).stdout
    return {name: ROOT / name for name in listing.splitlines() if (ROOT / name).is_file()}


def made_by(program, page, folder, build):
    """The files that a program makes of a page or a notebook, from the last run if nothing has changed since: neither page, nor
    solver, nor program. Of a notebook whose packages are missing, a page that says so.
    """
    solver = sorted(build.glob("python/marble/_core*.so"))
    parts = [page.read_bytes(), *(str(path.stat().st_mtime).encode() for path in [*solver, program, SITE / "matplotlibrc"])]
    run = folder / "runs" / f"{page.stem}{page.suffix}-{hashlib.sha256(b''.join(parts)).hexdigest()[:12]}"
    if not (run / "done").exists():
        for old in folder.glob(f"runs/{page.stem}{page.suffix}-*"):
            shutil.rmtree(old)
        run.mkdir(parents=True)
        print(f"runs {page.relative_to(ROOT)}", flush=True)
        status = subprocess.run([sys.executable, program, page, run, build]).returncode
        if status not in (0, MISSING):
            shutil.rmtree(run)
            sys.exit(1)
        if status == 0:
            (run / "done").touch()
    return {f"{page.relative_to(ROOT).parent}/{path.name}": path
            for kind in ("*.md", "*.svg", "*.png") for path in run.glob(kind)}


def main():
    folder, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    source = folder / "source"
    wanted = committed()
    old = list(benchmarks.differences(benchmarks.PAGE.read_text(encoding="utf-8")))
    if old:
        sys.exit("\n".join(f"docs/benchmarks.md:{at}: {message}" for at, message in old))
    for page in [ROOT / "docs/gallery.md", *sorted(ROOT.glob("docs/learn/*.md")), *sorted(ROOT.glob("docs/guides/*.md"))]:
        if any(DRAWS.search(body) for _, _, body in pages.blocks(page.read_text(encoding="utf-8"))):
            wanted |= made_by(SITE / "pages.py", page, folder, build)
    for page in sorted(ROOT.glob("docs/notebooks/*.ipynb")):
        wanted |= made_by(SITE / "notebooks.py", page, folder, build)
    for name, path in wanted.items():
        copy(path, source / name)
    made = {source / name for name in wanted}
    for name, text in reference.pages(build, folder).items():
        path = source / "docs/reference" / name
        made.add(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
    for path in list(source.rglob("*")):
        if path.is_file() and path not in made:
            path.unlink()


main()
