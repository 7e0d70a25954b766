"""A first answer of the front page or of client/SOLVING.md, done word for word: its files written, its commands run in a checkout and in an empty folder
against a real server, and what they print compared with what it shows.

Usage: quick_start.py ROOT BUILD_DIR SECTION [FOLDER_OF_PROGRAMS]    exit 77 where what it needs is not there
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.dont_write_bytecode = True
ROOT, BUILD, SECTION = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve(), sys.argv[3]
sys.path.insert(0, str(ROOT / "tests" / "page"))
from server import Server  # noqa: E402

# What is not in every checkout, or is made in it by the commands.
MADE = shutil.ignore_patterns("node_modules", "dist", "build", "docs", "generated", "*.tgz", "*.egg-info", "__pycache__")


def blocks_of(section):
    pages = "".join((ROOT / page).read_text(encoding="utf-8") for page in ("README.md", "client/SOLVING.md"))
    start = pages.index(f"\n### {section}\n")
    end = re.compile(r"^##|\Z", re.MULTILINE).search(pages, start + len(section) + 6).start()
    return re.findall(r"^```(\w+)\n(.*?)^```$", pages[start:end], re.DOTALL | re.MULTILINE)


def skip(why):
    print(f"skipped: {why}")
    sys.exit(77)


def node_is_there():
    try:
        version = subprocess.run(["node", "--version"], capture_output=True, text=True, check=True).stdout
        subprocess.run(["npm", "view", "@grpc/grpc-js", "version"], capture_output=True, check=True, timeout=60)
    except (OSError, subprocess.SubprocessError):
        skip("node or npm is not installed, or the package registry does not answer")
    if int(version.strip("v").split(".")[0]) < 20:
        skip(f"node {version.strip()} is older than 20")


def make_checkout(folder):
    """What the commands touch of a checkout that was built."""
    for part in ("client/ts", "client/python", "proto"):
        shutil.copytree(ROOT / part, folder / part, ignore=MADE)
    (folder / "deploy").mkdir()
    for name in ("LICENSE", "deploy/VERSION"):
        shutil.copy(ROOT / name, folder / name)
    (folder / "build").mkdir()
    (folder / "build" / "release").symlink_to(BUILD)


def done_in(work, blocks, environment):
    """What the commands after the files print."""
    (work / "own").mkdir()
    files = [at for at, (kind, _) in enumerate(blocks) if kind not in ("sh", "text")]
    for kind, text in (blocks[at] for at in files):
        name = "first.json" if kind == "json" else text.split("\n")[0].split()[-1]
        (work / "own" / name).write_text(text, encoding="utf-8")
    before = [text for kind, text in blocks[:files[0]] if kind == "sh"]
    after = [text for kind, text in blocks[files[-1]:] if kind == "sh"]
    assert after, "no command runs the file"
    script = "\n".join(["set -eu", "cd checkout", "exec 3>&1 >&2", *before, f"cd '{work}/own'", "exec >&3", *after])
    run = subprocess.run(["bash", "-c", script], cwd=work, env=environment, stdout=subprocess.PIPE, text=True, timeout=500)
    assert run.returncode == 0, f"exit {run.returncode}, after\n{run.stdout}"
    return run.stdout


def main():
    blocks = blocks_of(SECTION)
    shown = [text for kind, text in blocks if kind == "text"]
    assert len(shown) == 1 and blocks[-1][0] == "text", "a quick start ends in what it prints"
    if any("npm " in text for kind, text in blocks if kind == "sh"):
        node_is_there()
    if any("curl " in text for kind, text in blocks if kind == "sh") and shutil.which("curl") is None:
        skip("curl is not installed")
    with tempfile.TemporaryDirectory(prefix="marble readme ") as work:
        work = pathlib.Path(work)
        make_checkout(work / "checkout")
        (work / "home").mkdir()
        # Those that were built, then Debian's, its Python above all; npm keeps what it has fetched before.
        path = os.pathsep.join([*sys.argv[4:], str(BUILD / "bin"), "/usr/bin", os.environ["PATH"]])
        cache = os.environ.get("npm_config_cache") or str(pathlib.Path.home() / ".npm")
        server = Server(BUILD / "bin")
        try:
            printed = done_in(work, blocks, {**os.environ, "PATH": path, "HOME": str(work / "home"),
                                             "MARBLE_SERVER": server.address, "MARBLE_HTTP": server.http, "npm_config_cache": cache})
        finally:
            server.stop()
    # Builds talk before their program does.
    assert printed.endswith(shown[0]), f"the page shows\n{shown[0]}\nand this was printed:\n{printed}"
    print(shown[0], end="")


main()
