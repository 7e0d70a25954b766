"""Runs the code of a page of docs/ in a folder, block after block, and compares what it prints with what the page shows.

A block of `python` runs in one namespace, a block of `sh` in one shell. A block whose first line is a comment with a
file's name is written to that file. A block of `text` is what was printed since the block of `text` before. Blocks in
tabs with other names than Python or Shell, such as C++, are a sequence of their own. Indented blocks are not run.

Usage: pages.py PAGE FOLDER BUILD_DIR [TAB]    runs the page's sequence, or that of a tab; the folder must be empty
"""

import contextlib
import difflib
import io
import os
import pathlib
import re
import subprocess
import sys

DOCS = pathlib.Path(__file__).resolve().parents[1]
MAIN = ("Python", "Shell")
MARK = "\x1e"  # separates the output of blocks


def blocks(text, tab=""):
    """(language, line, body) of each block of a sequence."""
    current = ""
    for found in re.finditer(r"^:+\{tab-item\} ([^\n]+)$|^(::::+)$|^```(\w+)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        if found[1] or found[2]:
            current = "" if found[1] in (None, *MAIN) else found[1]
        elif current == tab:
            yield found[3], text.count("\n", 0, found.start()) + 2, found[4]


class Shell:
    """A bash that ends at the first command that fails, and then ends what it has started in the background."""

    END = f"trap 'kill $(jobs -p) 2>/dev/null; wait; printf \"{MARK}\\n\"' EXIT\n"

    def __init__(self):
        self.process = subprocess.Popen(["bash", "-e"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True)
        self.process.stdin.write(self.END)

    def run(self, commands):
        """What they print."""
        self.process.stdin.write(f"{commands}\nprintf '{MARK}{MARK}\\n'\n")
        self.process.stdin.flush()
        printed = ""
        while not printed.endswith(MARK + "\n"):
            printed += self.process.stdout.readline() or sys.exit("the shell has ended")
        if not printed.endswith(2 * MARK + "\n"):
            sys.exit(f"a command failed, after\n{printed[:-2]}")
        return printed[:-3]

    def end(self):
        self.process.stdin.close()
        self.process.wait()


def file_of(body):
    found = re.match(r"(?:#|//) ([\w-]+\.\w+)\n", body)
    return found and found[1]


def run(page, tab):
    """Runs it in the current folder, and exits with a message at the first difference."""
    shell, names, printed = None, {"__name__": page.stem}, ""
    sequence = list(blocks(page.read_text(encoding="utf-8"), tab))
    if not sequence:
        sys.exit(f"{page}: has no blocks to run{tab and ' in tabs ' + tab}")
    try:
        for language, line, body in sequence:
            if language == "text":
                if printed != body:
                    sys.exit(f"{page}:{line}: the page shows (-), and the code prints (+):\n" + "".join(difflib.unified_diff(
                        body.splitlines(keepends=True), printed.splitlines(keepends=True), n=2)))
                printed = ""
            elif name := file_of(body):
                pathlib.Path(name).write_text(body, encoding="utf-8")
            elif language == "python":
                out = io.StringIO()
                with contextlib.redirect_stdout(out):
                    exec(compile("\n" * (line - 1) + body, str(page), "exec"), names)
                printed += out.getvalue()
            elif language == "sh":
                shell = shell or Shell()
                printed += shell.run(body)
            else:
                sys.exit(f"{page}:{line}: a block of {language} without a file's name in its first line")
    finally:
        if shell:
            shell.end()
    if printed:
        sys.exit(f"{page}: prints what it does not show:\n{printed}")


def environment(build):
    """For a page's code: the programs and the package of a build, and the style of the site's pictures."""
    path = os.pathsep.join([str(build / "bin"), os.environ["PATH"]])
    kept = {key: value for key, value in os.environ.items() if not key.startswith("MARBLE_")}
    return {**kept, "PATH": path, "PYTHONPATH": str(build / "python"), "PYTHONDONTWRITEBYTECODE": "1",
            "MPLBACKEND": "Agg", "MATPLOTLIBRC": str(DOCS / "site/matplotlibrc")}


if __name__ == "__main__":
    page, folder, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
    wanted = environment(build)
    if os.environ.get("MATPLOTLIBRC") != wanted["MATPLOTLIBRC"]:  # from the start of Python on
        os.execve(sys.executable, [sys.executable, *sys.argv], wanted)
    os.chdir(folder)
    run(page, *sys.argv[4:] or [""])
