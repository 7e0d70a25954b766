"""What the loader reads of programs and libraries, and how they are hardened."""

import pathlib
import re
import subprocess
import sys

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "deploy"))
from debian_packages import is_linked

# Of the start-up code that every program of this system links: where it has no mark of control flow protection, the linker
# leaves it out of the program too.
START_UP = "Scrt1.o"


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, f"{command}: {done.stdout[-4000:]}{done.stderr[-4000:]}"
    return done.stdout


def linked_files(folder, leave_out=()):
    """Programs and shared libraries below a folder; names of `leave_out` are not entered."""
    for path in sorted(pathlib.Path(folder).iterdir()):
        if path.is_symlink() or path.name in leave_out:
            continue
        if path.is_dir():
            yield from linked_files(path, leave_out)
        elif path.is_file() and is_linked(path):
            yield path


def search_path_faults(path):
    """Entries of RPATH and RUNPATH that depend on the current directory: empty and relative ones."""
    faults = []
    for found in re.findall(r"\((?:RPATH|RUNPATH)\).*\[(.*)\]$", run("readelf", "--wide", "--dynamic", path), re.MULTILINE):
        for entry in found.split(":"):
            if not entry.startswith(("/", "$ORIGIN/", "${ORIGIN}/")) and entry not in ("$ORIGIN", "${ORIGIN}"):
                faults.append(f"{path} searches \"{entry}\" of [{found}] for libraries")
    return faults


def has_flow_protection(path):
    return "IBT, SHSTK" in run("readelf", "--wide", "--notes", path)


def hardening_faults(*paths):
    """What hardening-check does not find."""
    start_up = run("cc", f"-print-file-name={START_UP}").strip()
    allowed = [] if has_flow_protection(start_up) else ["--nocfprotection"]
    done = subprocess.run(["hardening-check", *allowed, *map(str, paths)], capture_output=True, text=True)
    return [] if done.returncode == 0 else [done.stdout + done.stderr]
