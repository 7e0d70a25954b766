"""The Octave client on Debian's Octave, where it is installed (octave-dev): solve, session, LCQPow's order, the bits of `marble`.

Usage: octave_test.py BUILD_DIR
"""

import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BUILD = pathlib.Path(sys.argv[1]).resolve()
FOLDER = ROOT / "client/c/octave"
ENVIRONMENT = {**os.environ, "MARBLE_SERVER": "local"}

if shutil.which("mkoctfile") is None or shutil.which("octave-cli") is None:
    print("octave-dev is not installed: the Octave client is not tested")
    sys.exit(77)


def run(*command):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=240, env=ENVIRONMENT)
    if done.returncode != 0:
        sys.exit(done.stdout + done.stderr)
    return done.stdout


def script(problem):
    """A function that makes the problem; Octave's own reader of JSON loses the last bits."""
    def column(numbers):
        return "[" + "; ".join(map(repr, numbers)) + "]"
    lines = [f"p.{key} = {column(problem[key])};" for key in "gbdlr" if problem.get(key)]
    for key in "QACLR":
        t = problem.get(key)
        if t and t["rows"]:
            lines.append(f"p.{key} = sparse(1 + {column(t['i'])}, 1 + {column(t['j'])}, {column(t['v'])}, "
                         f"{t['rows']}, {t['cols']});")
    return "\n".join(["function p = hopper()", f"p.c0 = {problem.get('c0', 0)!r};", *lines, "end\n"])


with tempfile.TemporaryDirectory() as work:
    run("mkoctfile", "--mex", "-o", f"{work}/marble_mex.mex", f"-I{ROOT}/client/c/include", FOLDER / "marble_mex.c",
        f"-L{BUILD}/client/c", "-lmarble", f"-Wl,-rpath,{BUILD}/client/c")
    hopper = pathlib.Path(work) / "hopper.json"
    hopper.write_text(run(BUILD / "bin/marble", "example", "hopper", "--steps", "5"))
    (pathlib.Path(work) / "hopper.m").write_text(script(json.loads(hopper.read_text())))
    answer = json.loads(run(BUILD / "bin/marble", "solve", "--quiet", "--output", "json", hopper))
    reported = run("octave-cli", "--no-gui", "--norc", "--path", work, "--path", FOLDER, "--path", ROOT / "tests/c", "--eval",
               "octave_test").split()
    expected = [struct.pack(">d", number).hex() for number in answer["z"]]
    if reported != expected:
        sys.exit(f"other bits than the program's: {reported[:3]}… and {expected[:3]}…")
