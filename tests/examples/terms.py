"""Whether docs/terms.md names what exists, and every status, kind and stationarity: names of the contract, of options, of
the server's settings, and of the Python package.

Usage: terms.py ROOT BUILD_DIR
"""

import ast
import pathlib
import re
import subprocess
import sys

root, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
sys.path.insert(0, str(build / "python"))
import marble  # noqa: E402


def known():
    """All names, and those that the page must have."""
    values = {value.value for kind in (marble.Status, marble.SolutionKind, marble.Stationarity) for value in kind}
    names = set(marble.__all__) | values
    for path in (root / "client/python/src/marble").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.AsyncFunctionDef):
                names.add(node.name)
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                names.add(node.target.id)
            elif isinstance(node, ast.arg):
                names.add(node.arg)
            elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant):
                names.add(str(node.value.value))  # of enumerations
    names |= set(re.findall(r"^\| `(\w+)`", (root / "core/OPTIONS.md").read_text(encoding="utf-8"), re.MULTILINE))
    settings = subprocess.run([build / "bin/marble-server", "--help"], capture_output=True, text=True, check=True).stdout
    names |= {flag.replace("-", "_") for flag in re.findall(r"^  --([\w-]+)", settings, re.MULTILINE)}
    for path in root.glob("proto/marble/v1/*.proto"):
        names |= set(re.findall(r"^\s+(?:\w+ )+(\w+)(?: = \d+|\()", path.read_text(encoding="utf-8"), re.MULTILINE))
    return names, values


names, needed = known()
rows = re.findall(r"^\| ([^|]+) \| .* \| ([^|]*) \|$", (root / "docs/terms.md").read_text(encoding="utf-8"), re.MULTILINE)[2:]
used = {name: term for term, cell in rows for name in re.findall(r"`(\w+)`", cell)}
terms = [term for term, _ in rows]
faults = [f"{used[name]}: nothing is named {name}" for name in sorted(set(used) - names)]
faults += [f"no term has {name}" for name in sorted(needed - set(used))]
faults += [f"{term}: is not in alphabetical order" for before, term in zip(terms, terms[1:]) if before.lower() > term.lower()]
print("\n".join([*faults, f"{len(rows)} terms, {len(used)} names, {len(faults)} faults"]))
sys.exit(1 if faults or not rows else 0)
