#!/usr/bin/env python3
"""Solves an LCQP to its global optimum by CPLEX and by SCIP, those of them that are installed, each pair as a special ordered
set of its two sides (SOS1), and prints a line for each: name, seconds, objective, bound, nodes, status. What a solver refuses,
as CPLEX's community edition does above 1,000 variables or rows, has nan for numbers.

Usage: global_peers.py PROBLEM.json SECONDS   as `suite global --peers` calls it; PROBLEM.json as client/FORMATS.md says
"""

import json
import math
import sys
import time

GAP = 1e-6
THREADS = 2


class Problem:
    """min ½zᵀQz + gᵀz + c0, rows (entries, right-hand side, whether equal), pairs of variables; s and t come after z."""

    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            data = json.load(file)
        n = data["n"]
        pairs = len(data.get("l", []))
        self.variables = n + 2 * pairs
        self.free = n
        self.linear = data["g"] + [0.0] * (2 * pairs)
        self.constant = data.get("c0", 0.0)
        entries = {}
        for i, j, value in self._entries(data.get("Q")):
            entries[i, j] = entries.get((i, j), 0.0) + value
        self.quadratic = entries
        self.rows = []
        for name, offset, equal, first in (("A", "b", True, None), ("C", "d", False, None), ("L", "l", True, n),
                                           ("R", "r", True, n + pairs)):
            rows = [{} for _ in data.get(offset, [])]
            for i, j, value in self._entries(data.get(name)):
                rows[i][j] = rows[i].get(j, 0.0) + value
            for i, row in enumerate(rows):
                if first is not None:
                    row[first + i] = -1.0
                self.rows.append((row, -data[offset][i], equal))
        self.pairs = [(n + i, n + pairs + i) for i in range(pairs)]

    @staticmethod
    def _entries(matrix):
        return zip(matrix["i"], matrix["j"], matrix["v"]) if matrix else ()


def cplex(p, seconds):
    import cplex as package

    model = package.Cplex()
    for stream in (model.set_log_stream, model.set_error_stream, model.set_warning_stream, model.set_results_stream):
        stream(None)
    least = [-package.infinity] * p.free + [0.0] * (p.variables - p.free)
    model.variables.add(obj=p.linear, lb=least, ub=[package.infinity] * p.variables)
    model.linear_constraints.add(
        lin_expr=[package.SparsePair(list(row), list(row.values())) for row, _, _ in p.rows],
        senses="".join("E" if equal else "G" for _, _, equal in p.rows), rhs=[right for _, right, _ in p.rows])
    columns = [([], []) for _ in range(p.variables)]
    for (i, j), value in p.quadratic.items():
        columns[i][0].append(j)
        columns[i][1].append(value)
    model.objective.set_quadratic([package.SparsePair(*column) for column in columns])
    model.objective.set_offset(p.constant)
    for s, t in p.pairs:
        model.SOS.add(type="1", SOS=package.SparsePair([s, t], [1.0, 2.0]))
    model.parameters.timelimit.set(seconds)
    model.parameters.threads.set(THREADS)
    model.parameters.mip.tolerances.mipgap.set(GAP)
    begin = time.perf_counter()
    try:
        model.solve()
    except package.exceptions.CplexSolverError as error:
        return time.perf_counter() - begin, math.nan, math.nan, 0, "refused" if error.args[2] == 1016 else "error"
    took = time.perf_counter() - begin
    answer = model.solution
    objective = answer.get_objective_value() if answer.is_primal_feasible() else math.inf
    return (took, objective, answer.MIP.get_best_objective(), answer.progress.get_num_nodes_processed(),
            answer.get_status_string())


def scip(p, seconds):
    import pyscipopt as package

    model = package.Model()
    model.hideOutput()
    variables = [model.addVar(lb=None if i < p.free else 0.0) for i in range(p.variables)]
    cost = model.addVar(lb=None)
    model.setObjective(cost)
    square = package.quicksum(0.5 * value * variables[i] * variables[j] for (i, j), value in p.quadratic.items())
    linear = package.quicksum(value * v for value, v in zip(p.linear, variables) if value)
    model.addCons(square + linear + p.constant <= cost)
    for row, right, equal in p.rows:
        image = package.quicksum(value * variables[j] for j, value in row.items())
        model.addCons(image == right if equal else image >= right)
    for s, t in p.pairs:
        model.addConsSOS1([variables[s], variables[t]])
    model.setParam("limits/time", seconds)
    model.setParam("limits/gap", GAP)
    begin = time.perf_counter()
    model.optimize()
    took = time.perf_counter() - begin
    objective = model.getPrimalbound() if model.getNSols() > 0 else math.inf
    return took, objective, model.getDualbound(), model.getNTotalNodes(), model.getStatus()


def main():
    problem = Problem(sys.argv[1])
    for solve in (cplex, scip):
        try:
            seconds, objective, bound, nodes, status = solve(problem, float(sys.argv[2]))
        except ImportError:
            print(solve.__name__, math.nan, math.nan, math.nan, 0, "missing")
            continue
        print(solve.__name__, seconds, objective, bound, nodes, status.replace(" ", "_"))


if __name__ == "__main__":
    main()
