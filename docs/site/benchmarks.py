#!/usr/bin/env python3
"""The tables of docs/benchmarks.md, computed from the runs in docs/records and from the tables of loadtest/MEASURED.md.

A line `<!-- figures: NAME -->` of the page begins a part that `NAME` below makes; `<!-- end -->` ends it.

Usage: benchmarks.py [PAGE]              exits with 1 and a line for each difference between page and records, for each figure
                                         outside such parts, and for each of README that Measurements lack
       benchmarks.py --write             writes the parts anew
       benchmarks.py --record NAME...    runs the command of a record with MARBLE_BUILD, build/release by default, and keeps
                                         what it prints; then --write
"""

import csv
import itertools
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import textwrap
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
RECORDS = ROOT / "docs/records"
PAGE = ROOT / "docs/benchmarks.md"
PART = re.compile(r"(?<=^<!-- figures: )(\w+) -->\n(.*?)(?=^<!-- end -->$)", re.DOTALL | re.MULTILINE)
SOLVED = 1e-4  # what `suite qp` accepts as the same objective
FIGURE = r"(?<![\w.])\d+(?:[.,]\d+)*(?![\w])"
EQUAL_TIMES = 1.05  # what is not called faster


def about():
    return tomllib.loads((RECORDS / "records.toml").read_text(encoding="utf-8"))


def lines(name):
    return (RECORDS / about()[name]["file"]).read_text(encoding="utf-8").splitlines()


def rows(name):
    return list(csv.DictReader(lines(name)))


def number(value, digits=3):
    """With so many digits, without an exponent from 0.001 to a million."""
    if not math.isfinite(value):
        return "none"
    if value and not 1e-3 <= abs(value) < 1e6:
        return f"{value:.0e}"
    shown = f"{value:.{digits}g}"
    return shown if "e" not in shown else f"{float(shown):.0f}"


def time_of(ms):
    return f"{number(ms)} ms" if ms < 1e3 else f"{number(ms / 1e3)} s"


def table(head, cells):
    aligned = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join(f"| {' | '.join(str(cell) for cell in row)} |" for row in [head, aligned, *cells]) + "\n"


def origin(*names):
    """Where figures come from, and the command that makes them anew."""
    text = ""
    for name in names:
        record = about()[name]
        parts = [f"[{record['file']}](records/{record['file']})"]
        parts += [f"run on {record['date']} on 2 cores with {record['load']}"] if "date" in record else []
        parts += [record["source"]] if "source" in record else []
        parts += [f"with {record['needs']}"] if "needs" in record else []
        again = f" Again: `docs/site/benchmarks.py --record {name}`." if "command" in record else ""
        text += "\n" + textwrap.fill(f"Record: {', '.join(parts)}.{again}", 120, break_on_hyphens=False) + "\n"
    return text


LABELS = {
    "marble": "Marble", "penalty_scp": "LCQPow's method, Marble's code", "relaxation": "Scholtes' relaxation, Marble's code",
    "lcqpow-sparse-reg-zero": "LCQPow, sparse qpOASES, regularized", "lcqpow-sparse-default-zero": "LCQPow, sparse qpOASES",
    "lcqpow-dense-default-zero": "LCQPow, dense qpOASES", "ipopt-nlp-zero": "IPOPT, s·t ≤ 0",
    "authors": "`path=paper`, the authors' constants", "algorithm1": "`path=algorithm1`, as printed"}


def macmpec_by_problem():
    found = {}
    for row in rows("macmpec"):
        found.setdefault(row["problem"], {})[row["solver"]] = row
    return found


def is_solved(row):
    return row["solved"] == "yes"


def fastest(of):
    """The solver with the least time among those that solve a problem."""
    solved = [name for name, row in of.items() if is_solved(row)]
    return min(solved, key=lambda name: float(of[name]["least"]))


def macmpec():
    problems = macmpec_by_problem()
    winners = [fastest(of) for of in problems.values()]
    cells = []
    for name in next(iter(problems.values())):
        own = [of[name] for of in problems.values()]
        times = sorted(1e3 * float(row["least"]) for row in own)
        small = [max(float(row[side]) for side in ("equality", "inequality", "max|min(s,t)|") if row[side]) <= 1e-4 for row in own]
        cells.append([LABELS[name], sum(small), sum(map(is_solved, own)), number(statistics.median(times)), number(times[-1]),
                      winners.count(name)])
    return table(["solver", f"feasible, of {len(problems)}", "solved", "median ms", "longest ms", "fastest on"], cells) + origin(
        "macmpec", "macmpec_peers")


def table1():
    printed = {(row["problem"], row["solver"]): row for row in rows("published_table1")}
    own = {(row["problem"].removeprefix("published "), row["solver"]): row for row in rows("table1")}
    problems = list(dict.fromkeys(problem for problem, _ in printed))

    def cell(row):
        return f"{float(row['objective']):.2f}, {time_of(float(row['ms']))}" if row["objective"] else "not feasible"
    cells = [[f"published: {solver.removesuffix(' (published)')}", *(cell(printed[problem, solver]) for problem in problems)]
             for solver in dict.fromkeys(solver for _, solver in printed)]
    cells += [[LABELS[solver], *(f"{float(row['objective']):.2f}, {time_of(1e3 * float(row['least']))}"
                                 for row in (own[problem, solver] for problem in problems))]
              for solver in dict.fromkeys(solver for _, solver in own)]
    return table(["objective, time", *problems], cells) + origin("published_table1", "table1")


def qps():
    """(problem, {solver: (ms, objective above Marble's, violation)})."""
    for line in lines("qp"):
        found = re.match(r"(\w+-\d+) +(\d+) +(\S+) +([\d.]+)  (.*)", line)
        if found:
            peers = re.findall(r"(\w+) ([\d.]+|nan) (\S+) (\S+)", found[5])
            yield found[1], {"marble": (float(found[4]), 0.0, float(found[3])),
                             **{name: tuple(float(value) for value in values) for name, *values in peers}}


def solves(answer):
    return abs(answer[1]) <= SOLVED


def qp():
    found, solvers = dict(qps()), ("marble", "piqp", "clarabel", "osqp")
    work = {line.split()[0]: line.split()[1] for line in lines("qp") if line.split(" ")[0] in found}
    cells = [[name, work[name], *(f"{number(of[solver][0])}{'' if solves(of[solver]) else ', not solved'}" for solver in solvers)]
             for name, of in found.items()]
    cells.append(["largest violation", "", *(f"{max(of[solver][2] for of in found.values() if solves(of[solver])):.0e}"
                                             for solver in solvers)])
    for solver in solvers[1:]:
        ratios = [of["marble"][0] / of[solver][0] for of in found.values() if solves(of[solver])]
        cells.append([f"Marble's time over {PEERS[solver]}'s, geometric mean", "", number(statistics.geometric_mean(ratios), 2),
                      "", "", ""])
    return table(["problem", "factorizations", "Marble, ms", "PIQP", "Clarabel", "OSQP"], cells) + origin("qp")


def nonlinear():
    cells = []
    for line in lines("nonlinear"):
        found = re.match(r"(\w+) +reached (\d+) of (\d+).*by products (\d+); said solved (\d+), rejected of them (\d+),.*"
                         r"median work (.*), median (\d+) ms", line)
        if found:
            name, reached, count, products, said, rejected, _, ms = found.groups()
            cells.append([{"marble": "`marble.nlp.solve_casadi`", "ipopt": "IPOPT, relaxation to 10⁻⁹, by CasADi",
                           "snopt": "SNOPT, by Drake"}[name], f"{reached} of {count}", products, said, rejected, ms])
    return table(["solver", "reached", "reached by products", "says solved", "of them rejected", "median ms"], cells) + origin(
        "nonlinear")


def proved():
    """(problem, Marble's row, {peer: row}) for each problem that `suite global` gave to its peers."""
    found = []
    for line in lines("proofs"):
        words = line.split()
        if not line.startswith(" ") and re.search(r" (yes|no) ", line):
            found.append((line[:12].strip(), line[12:].split(), {}))
        elif line.startswith("  ") and len(words) >= 6 and words[1] != "missing":
            found[-1][2][words[0]] = words[1:]
    return [(name, own, peers) for name, own, peers in found if peers]


def proofs():
    cells = []
    for name, own, peers in proved():
        status, yes, objective, bound, gap, nodes, _, seconds, *_ = own
        scip = peers["scip"]
        cells.append([name, number(float(objective), 7), "proved" if yes == "yes" else f"gap {100 * float(gap):.0f} %", nodes,
                      number(float(seconds)), *peer_cells(scip)])
    return table(["problem", "Marble: objective", "result", "nodes", "s", "SCIP: objective", "result", "nodes", "s"],
                 cells) + origin("proofs")


def peer_cells(row):
    status, objective, bound, _, nodes, seconds = row
    objective, bound = float(objective), float(bound)
    if status == "optimal":
        result = "proved"
    elif abs(bound) >= 1e19:
        result = "no bound"
    else:
        result = f"bound {number(bound, 4)}"
    return [number(objective, 7), result, nodes, number(float(seconds))]


def runs_of(task, controller):
    return [row for row in rows("control") if row["task"] == task and row["controller"] == controller]


def control():
    cells = []
    for task, controller in dict.fromkeys((row["task"], row["controller"]) for row in rows("control")):
        runs = runs_of(task, controller)
        costs = [float(row["cost"]) for row in runs]
        steps = [] if controller == "none" else [number(1e3 * statistics.median(float(row[key]) for row in runs), 2)
                                                 for key in ("solve_s_median", "solve_s_p99")]
        broken = "" if controller == "none" else number(max(float(row["complementarity_worst"]) for row in runs), 1)
        cells.append([f"`{task}`", {"none": "none", "marble": "Marble", "c3plus": "C3+"}[controller],
                      f"{sum(row['done'] == 'True' for row in runs)} of {len(runs)}", number(statistics.median(costs)),
                      number(max(costs)), broken, *(steps or ["", ""])])
    return table(["task", "controller", "done", "median cost", "worst cost", "largest violation of a pair", "solve, median ms",
                  "99 %"], cells) + origin("control")


def measured(heading, first):
    """Head and rows of the table of MEASURED whose first cell is `first`, under a heading."""
    text = (ROOT / "loadtest/MEASURED.md").read_text(encoding="utf-8").partition(f"## {heading}\n")[2]
    found = re.search(rf"^\| {re.escape(first)} \|.*\n\|[-: |]+\n((?:\|.*\n)+)", text, re.MULTILINE)
    head = found[0].splitlines()[0]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in [head, *found[1].splitlines()]]


def copied(heading, first, program, ran):
    head, *cells = measured(heading, first)
    anchor = heading.lower().replace(" ", "-")
    text = (f"Figures of [Measurements](../loadtest/MEASURED.md#{anchor}), {ran}, which has their conditions; the run's "
            f"output is not kept. Again: `{program}`.")
    return table(head, cells) + "\n" + textwrap.fill(text, 120, break_on_hyphens=False) + "\n"


def loops():
    return copied("Contact-implicit MPC in closed loop", "task", "loadtest/suite/lcs/compare", "of 2026-11-28")


def nosbench():
    return copied("NOSBENCH", "solver", "loadtest/suite/nosbench/compare DIR", "of 2026-11-28")


def service():
    return copied("Remote solves and load", "figure", "loadtest/run --long", "of 2026-11-22")


PEERS = {"piqp": "PIQP", "clarabel": "Clarabel", "osqp": "OSQP"}
GOALS = {"the same by unary calls": "overhead of a unary call of a tiny problem over a bare echo"}  # what "the same" is


def ahead():
    """Where others are ahead, by the same records."""
    problems = macmpec_by_problem()
    winners = {name: fastest(of) for name, of in problems.items()}
    others = [name for name, winner in winners.items() if winner != "marble"]
    slowest = max(others, key=lambda name: float(problems[name]["marble"]["least"]) / float(problems[name][winners[name]]["least"]))
    ratio = float(problems[slowest]["marble"]["least"]) / float(problems[slowest][winners[slowest]]["least"])
    lost = {name: min((of[s][0], s) for s in of if s != "marble" and solves(of[s])) for name, of in qps()}
    lost = {name: (dict(qps())[name]["marble"][0] / ms, s) for name, (ms, s) in lost.items()}
    lost = {name: at for name, at in lost.items() if at[0] > EQUAL_TIMES}
    own = {(row["problem"], row["solver"]): row for row in rows("table1")}
    printed = {(row["problem"], row["solver"]): row for row in rows("published_table1")}
    gates = [own["published gates", solver] for solver in ("marble", "authors")]
    nosbench_rows = measured("NOSBENCH", "solver")[1:]
    missed = [f"{GOALS.get(row[0], row[0])} ({row[1]})" for row in measured("Remote solves and load", "figure")[1:]
              if row[2] == "not reached"]
    medians = {found[1]: int(found[2]) for line in lines("nonlinear") if (found := re.match(r"(\w+) .*median (\d+) ms$", line))}
    quicker = [name for name in medians if medians[name] < medians["marble"]]
    cheaper = [task for task in dict.fromkeys(row["task"] for row in rows("control"))
               if statistics.median(float(row["cost"]) for row in runs_of(task, "c3plus"))
               < statistics.median(float(row["cost"]) for row in runs_of(task, "marble"))]
    items = [
        f"MacMPEC: on {len(others)} of {len(problems)} problems another solver that solves the problem is faster, on {slowest} "
        f"by a factor of {number(ratio, 2)}: Marble's time includes a proof of the optimum.",
        f"Published hopper: the published time of the authors' code is "
        f"{time_of(float(printed['hopper', 'Marble (published)']['ms']))}; "
        f"`path=paper` with their constants takes {time_of(1e3 * float(own['published hopper', 'authors']['least']))} in the run "
        f"below and Marble {time_of(1e3 * float(own['published hopper', 'marble']['least']))}, for a lower objective.",
        f"Published gates: `path=paper` with the authors' constants ends at {float(gates[1]['objective']):.2f}, Marble at "
        f"{float(gates[0]['objective']):.2f}; the first one violates its constraints by up to "
        f"{number(max(float(gates[1][key]) for key in ('equality', 'inequality', 'max|min(s,t)|')), 1)}.",
        f"QPs without pairs: on {len(lost)} of {len(dict(qps()))} another solver is faster by more than 5 %: "
        + ", ".join(f"{name} ({PEERS[at[1]]}, {number(at[0], 2)} times)" for name, at in lost.items()) + ".",
        "Nonlinear problems: " + (", ".join({"ipopt": "IPOPT", "snopt": "SNOPT"}[name] + f" takes {medians[name]} ms" for name in quicker)
                                  + f" in the median, Marble {medians['marble']} ms." if quicker else "none is faster in the median."),
        f"NOSBENCH: IPOPT's relaxation reaches {nosbench_rows[2][2]} problems by products and the best objective on "
        f"{nosbench_rows[2][3]}; Marble {nosbench_rows[1][2]} and {nosbench_rows[1][3]}.",
        "Control loops: " + (", ".join(f"on `{task}` C3+ has the lower median cost" for task in cheaper) or "C3+ has no lower median "
                             "cost in the run below") + ". In Measurements iLQR has it on `push_t` and `pivot`.",
        "Service: goals that are not reached: " + "; ".join(missed) + "."]
    return "".join(textwrap.fill(f"- {item}", 120, subsequent_indent="  ", break_on_hyphens=False) + "\n" for item in items)


PARTS = {function.__name__: function for function in (ahead, macmpec, table1, qp, nonlinear, nosbench, proofs, control, loops, service)}


def made(text):
    """The page with its parts as the records have them."""
    return PART.sub(lambda found: f"{found[1]} -->\n{PARTS[found[1]]()}", text)


def differences(text):
    """(line, message) of what the page says otherwise than the records, and of figures outside the parts."""
    for at, (have, need) in enumerate(itertools.zip_longest(text.splitlines(), made(text).splitlines()), 1):
        if have != need:
            yield at, f"the page has {have!r}, the records give {need!r}"
    absent = set(PARTS) - {found[1] for found in PART.finditer(text)}
    if absent:
        yield 1, f"the page lacks the parts {', '.join(sorted(absent))}"
    prose = PART.sub(lambda found: re.sub(r"[^\n]", "", found[0]), text)
    prose = re.sub(r"`[^`\n]*`|\]\([^)]*\)", "", prose)
    for at, line in enumerate(prose.splitlines(), 1):
        if re.search(r"(?<![\w-])\d+(?![\w⁻])", line) and not line.startswith("    "):
            yield at, f"a figure outside the parts that are computed: {line.strip()!r}"


def claims(readme):
    """(line, message) of figures of README that link to a section of Measurements which does not have them."""
    text = (ROOT / "loadtest/MEASURED.md").read_text(encoding="utf-8")
    parts = re.split(r"^## (.+)\n", text, flags=re.MULTILINE)
    sections = {title.lower().replace(" ", "-"): set(re.findall(FIGURE, body)) for title, body in zip(parts[1::2], parts[2::2])}
    for at, line in enumerate(readme.splitlines(), 1):
        for anchor in re.findall(r"\(loadtest/MEASURED\.md#([\w-]+)\)", line):
            absent = set(re.findall(FIGURE, re.sub(r"\]\([^)]*\)", "", line))) - sections.get(anchor, set())
            if absent:
                yield at, f"the section {anchor} of Measurements lacks {', '.join(sorted(absent))}"


def record(name):
    entry = about()[name]
    with tempfile.TemporaryDirectory() as folder:
        build = ROOT / os.environ.get("MARBLE_BUILD", "build/release")
        environment = {"PYTHON": "python3", **os.environ, "PYTHONPATH": str(build / "python"), "OUT": folder,
                       "PATH": os.pathsep.join([str(build / "bin"), os.environ["PATH"]])}
        done = subprocess.run(["bash", "-c", entry["command"]], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
    if done.returncode not in (0, 1) or not done.stdout:  # 1: not all problems are solved
        sys.exit(f"{name}: the command ended with {done.returncode}")
    (RECORDS / entry["file"]).write_text(done.stdout, encoding="utf-8")


def main():
    arguments = sys.argv[1:]
    if arguments[:1] == ["--record"]:
        for name in arguments[1:]:
            record(name)
    if arguments[:1] in (["--record"], ["--write"]):
        PAGE.write_text(made(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
        return
    page = pathlib.Path(arguments[0]) if arguments else PAGE
    found = list(differences(page.read_text(encoding="utf-8")))
    claimed = list(claims((ROOT / "README.md").read_text(encoding="utf-8")))
    print("\n".join([*(f"{page.name}:{at}: {message}" for at, message in found),
                     *(f"README.md:{at}: {message}" for at, message in claimed),
                     f"{len(PARTS)} parts, {len(found) + len(claimed)} differences"]))
    sys.exit(1 if found or claimed else 0)


if __name__ == "__main__":
    main()
