"""What rows of results say: shares by class, a performance profile, and the failures with their reasons."""

import csv
import math
import statistics
from collections import Counter

from judge import STATIONARY, Verdict
from problems import class_of

NUMBERS = ["limit_s", "seconds", "cpu_s", "objective", "bounds", "rows", "negative", "sides", "products",
           "stationarity", "strong"]
FIELDS = ["problem", "solver", "status", "said", "work", "variables", "rows_of_g", "pairs", *NUMBERS, "biactive",
          "detail"]
BEST = 1e-3  # of the best known objective, or of 1e-3, that an objective may be above it
RATIOS = [2.0 ** (k / 2) for k in range(21)]


def load(path):
    """The rows of a CSV of results, the latest of each problem and solver; none if there is no file."""
    rows = {}
    if path.exists():
        with path.open(newline="") as file:
            for row in csv.DictReader(file):
                if row.get("detail") is None:
                    continue  # of another file, or the last line of a run that was cut off
                for name in NUMBERS:
                    row[name] = float(row[name] or "inf")
                row |= {name: int(row[name] or 0) for name in ("work", "biactive")}
                row["said"] = row["said"] == "True"
                rows[row["problem"], row["solver"]] = row
    return rows


def fields_of(path):
    """The columns of a CSV that is continued; FIELDS of a new one. Errors: ValueError names a column that is missing."""
    header = path.open(newline="").readline().strip().split(",") if path.exists() else [""]
    if header == [""]:
        return FIELDS
    missing = [field for field in FIELDS if field not in header]
    if missing:
        raise ValueError(f"{path}: has no column {missing[0]}; name another file")
    return header


def verdict(row):
    return Verdict(**{name: row[name] for name in ("objective", "bounds", "rows", "negative", "sides", "products",
                                                   "stationarity", "strong", "biactive")})


def solved(row, by_products=False):
    """Feasible and stationary on its branch, by the judge, whatever the solver says."""
    found = verdict(row)
    return found.feasible(by_products) and found.stationary()


def best_of(rows):
    """{problem: the least objective of an x that is feasible by sides}."""
    best = {}
    for row in rows:
        if verdict(row).feasible():
            best[row["problem"]] = min(row["objective"], best.get(row["problem"], math.inf))
    return best


def reason(row):
    """Why a row is not solved: the status, and the residual that is too large."""
    found = verdict(row)
    if not found.feasible():
        which, amount = found.largest
        return f"{row['status']}: {which} {amount:.0e}"
    return f"{row['status']}: stationarity {found.stationarity:.0e}"


def tables(rows, solvers):
    """The text of all tables; rows: of one choice of problems."""
    enough = {name: best + BEST * max(BEST, abs(best)) for name, best in best_of(rows).items()}
    by_solver = {name: [row for row in rows if row["solver"] == name] for name in solvers}
    lines = [f"{'solver':<16}{'solved':>8}{'%':>7}{'products':>10}{'strong':>8}{'best':>6}{'said':>6}{'wrong':>7}"
             f"{'work':>8}{'CPU s':>8}"]
    for name, own in by_solver.items():
        if not own:
            continue
        good = [row for row in own if solved(row)]
        lines.append(
            f"{name:<16}{f'{len(good)}/{len(own)}':>8}{100 * len(good) / len(own):7.1f}"
            f"{sum(solved(row, True) for row in own):>10}{sum(row['strong'] <= STATIONARY for row in good):>8}"
            f"{sum(row['objective'] <= enough[row['problem']] for row in good):>6}"
            f"{sum(row['said'] for row in own):>6}{sum(row['said'] and not solved(row) for row in own):>7}"
            f"{statistics.median(row['work'] for row in own):>8g}"
            f"{statistics.median(row['cpu_s'] for row in own):>8.2f}")
    lines += ["", f"{'class':<10}{'variables':>12}{'pairs':>10}" + "".join(f"{name:>16}" for name in by_solver)]
    for key in sorted({class_of(row["problem"]) for row in rows}):
        own = [row for row in rows if class_of(row["problem"]) == key]
        sizes = [sorted({int(row[name]) for row in own if row[name]}) for name in ("variables", "pairs")]
        text = [f"{size[0]}-{size[-1]}" if len(size) > 1 else f"{size[0]}" if size else "" for size in sizes]
        lines.append(f"{key:<10}{text[0]:>12}{text[1]:>10}" + "".join(
            f"{f'{sum(solved(row) for row in each)}/{len(each)}':>16}"
            for each in ([row for row in own if row["solver"] == name] for name in by_solver)))
    for name, own in by_solver.items():
        failed = [row for row in own if not solved(row)]
        if failed:
            counted = Counter(f"{row['status']}, {'infeasible' if not verdict(row).feasible() else 'not stationary'}"
                              for row in failed)
            lines += ["", f"{name}, not solved: " + "; ".join(f"{n} {what}" for what, n in counted.most_common())]
            lines += [f"    {row['problem']:<44} {reason(row)}; {row['detail'][:110]}" for row in failed]
    return "\n".join(lines)


def profile(rows, solvers):
    """(solver, ratio, share): of all problems, what is solved within ratio times the least CPU time."""
    seconds = {}
    for row in rows:
        if row["solver"] in solvers and solved(row):
            seconds.setdefault(row["problem"], {})[row["solver"]] = max(row["cpu_s"], 1e-3)
    count = len({row["problem"] for row in rows})
    return [(name, ratio, sum(times.get(name, math.inf) <= ratio * min(times.values()) for times in seconds.values())
             / max(1, count)) for name in solvers for ratio in RATIOS]
