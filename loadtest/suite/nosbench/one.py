"""One solve of one problem by one solver, judged; a line of JSON. Usage: one.py FILE SOLVER SECONDS

compare runs each solve in such a process, so that one that hangs, crashes or needs too much memory ends alone.
"""

import dataclasses
import json
import sys
import time
import warnings

from judge import judge
from problems import BadProblem, read
from solvers import SOLVERS


def main():
    path, solver, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3])
    warnings.simplefilter("ignore")
    row = {"status": "error", "said": False, "work": 0, "seconds": 0.0, "cpu_s": 0.0, "detail": ""}
    try:
        problem = read(path)
        row |= {"variables": problem.w.numel(), "rows_of_g": problem.g.numel(), "pairs": problem.G.numel()}
        solve, begun, cpu = SOLVERS[solver](), time.perf_counter(), time.process_time()
        try:
            reply = solve(problem, seconds)
        finally:
            row["seconds"], row["cpu_s"] = time.perf_counter() - begun, time.process_time() - cpu
        row |= {"status": reply.status, "said": reply.solved, "work": reply.work, "detail": reply.detail}
        row |= dataclasses.asdict(judge(problem, reply.x))
    except (BadProblem, ImportError) as error:
        row |= {"status": "unusable", "detail": str(error)}
    except Exception as error:
        row["detail"] = f"{type(error).__name__}: {error}".partition("\n")[0][:200]
    print(json.dumps(row))


if __name__ == "__main__":
    main()
