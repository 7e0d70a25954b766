"""Whether docs/benchmarks.md has the figures of docs/records and of loadtest/MEASURED.md, and README those of the latter; and
whether the check finds a figure that was edited in a page or in a record.

Usage: benchmarks.py ROOT
"""

import pathlib
import re
import shutil
import sys
import tempfile

root = pathlib.Path(sys.argv[1]).resolve()
sys.path.insert(0, str(root / "docs/site"))
import benchmarks  # noqa: E402

page = (root / "docs/benchmarks.md").read_text(encoding="utf-8")
faults = [f"docs/benchmarks.md:{at}: {message}" for at, message in benchmarks.differences(page)]


def edited(text, at):
    """With another digit at the first one from there on."""
    found = re.compile(r"\d").search(text, at)
    return text[:found.start()] + str((int(found[0]) + 1) % 10) + text[found.end():], text.count("\n", 0, found.start()) + 1


changed = 0
for part in benchmarks.PART.finditer(page):
    for at in (part.start(2), (part.start(2) + part.end(2)) // 2):  # in its first line and amid it
        text, line = edited(page, at)
        changed += 1
        if line not in [where for where, _ in benchmarks.differences(text)]:
            faults.append(f"{part[1]}: an edited figure in line {line} is not found")
prose = page.replace("## Service\n", "## Service\nIt takes 7 ms.\n")
if not list(benchmarks.differences(prose)):
    faults.append("a figure outside the parts is not found")

readme = (root / "README.md").read_text(encoding="utf-8")
faults += [f"README.md:{at}: {message}" for at, message in benchmarks.claims(readme)]
for line in [line for line in readme.splitlines() if "loadtest/MEASURED.md#" in line]:
    figure = re.search(r"\[\D*(\d[\d.]*)", line)
    changed += 1
    if not list(benchmarks.claims(readme.replace(line, line[:figure.start(1)] + "987.654" + line[figure.end(1):]))):
        faults.append(f"README.md: an edited figure is not found: {line}")

with tempfile.TemporaryDirectory() as folder:
    copy = pathlib.Path(folder) / "records"
    shutil.copytree(benchmarks.RECORDS, copy)
    benchmarks.RECORDS = copy
    if list(benchmarks.differences(page)) and not faults:
        faults.append("a copy of the records makes a difference")
    for name, find, put in (("macmpec.csv", "bard1,marble,solved,yes", "bard1,marble,solved,no"), ("qp.txt", "piqp ", "piqp 9"),
                            ("nonlinear.txt", "reached 46", "reached 45"), ("control.csv", "marble,0,True", "marble,0,False"),
                            ("proofs.txt", "rocket       solved              yes", "rocket       solved              no "),
                            ("table1.csv", "607.690352", "507.690352"), ("published_table1.csv", "31.68", "31.67")):
        kept = (copy / name).read_text(encoding="utf-8")
        if find not in kept:
            faults.append(f"{name}: lacks {find!r}")
        (copy / name).write_text(kept.replace(find, put, 1), encoding="utf-8")
        if not list(benchmarks.differences(page)):
            faults.append(f"{name}: an edited record is not found")
        (copy / name).write_text(kept, encoding="utf-8")

print("\n".join([*faults, f"{changed} edits of the page, {len(faults)} faults"]))
sys.exit(1 if faults or not changed else 0)
