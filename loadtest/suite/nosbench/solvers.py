"""What is asked to solve the problems: Marble's nonlinear planner, and IPOPT where CasADi has it.

Each takes a problem and a number of seconds, and returns a `Reply`.
"""

import dataclasses
import time

import numpy as np

RELAXATIONS = [10.0**-k for k in range(10)]  # t of G H <= t


@dataclasses.dataclass
class Reply:
    """What a solver said; work: LCQPs of Marble, iterations of IPOPT."""

    solved: bool
    status: str
    x: np.ndarray
    work: int
    detail: str = ""


class Marble:
    """marble.nlp.solve_casadi with settings. Work: LCQPs."""

    def __init__(self, **settings):
        import marble  # noqa: F401

        self.settings = settings

    def __call__(self, problem, seconds):
        import marble

        answer = marble.nlp.solve_casadi(
            {"x": problem.w, "p": problem.p, "f": problem.f, "g": problem.g, "G": problem.G, "H": problem.H},
            problem.w0, p=problem.p0, lbx=problem.lbw, ubx=problem.ubw, lbg=problem.lbg, ubg=problem.ubg,
            **{"time_limit_s": seconds, "iteration_limit": 1000, **self.settings})
        return Reply(answer.status.value == "solved", answer.status.value, answer.x, answer.ticks, answer.detail)


class Ipopt:
    """IPOPT by CasADi with G, H >= 0 and G H <= t, each t from the answer before. Work: iterations.

    relaxations: of t. Scholtes' relaxation is from 1 by 0.1 to 1e-9; t = 0 alone is the product form.
    """

    def __init__(self, relaxations):
        import casadi as ca

        if not ca.has_nlpsol("ipopt"):
            raise ImportError("CasADi without IPOPT")
        self.relaxations = relaxations

    def __call__(self, problem, seconds):
        import casadi as ca

        ends = time.perf_counter() + seconds
        t, pairs = ca.SX.sym("t"), problem.G.numel()
        rows = ca.vertcat(problem.g, problem.G, problem.H, problem.G * problem.H - t)
        options = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-9,
                   "ipopt.constr_viol_tol": 1e-9, "ipopt.dual_inf_tol": 1e-9, "ipopt.compl_inf_tol": 1e-9,
                   "ipopt.mu_strategy": "adaptive", "ipopt.mu_oracle": "quality-function",
                   "ipopt.bound_relax_factor": 0.0, "ipopt.max_iter": 500, "ipopt.max_wall_time": seconds,
                   "show_eval_warnings": False}
        solver = ca.nlpsol("homotopy", "ipopt", {"x": problem.w, "p": ca.vertcat(problem.p, t), "f": problem.f,
                                                 "g": rows}, options)
        x, work, status, steps = problem.w0, 0, "", 0
        for now in self.relaxations:
            if time.perf_counter() > ends:
                return Reply(False, "time_limit", x, work, f"before t = {now:g}")
            given = solver(x0=x, p=np.append(problem.p0, now), lbx=problem.lbw, ubx=problem.ubw,
                           lbg=np.concatenate([problem.lbg, np.zeros(2 * pairs), np.full(pairs, -np.inf)]),
                           ubg=np.concatenate([problem.ubg, np.full(2 * pairs, np.inf), np.zeros(pairs)]))
            stats = solver.stats()
            work, status, steps = work + stats["iter_count"], stats["return_status"], steps + bool(stats["success"])
            x = np.asarray(given["x"]).ravel()
        return Reply(bool(stats["success"]), status, x, work, f"{steps} of {len(self.relaxations)} t solved")


SOLVERS = {"marble": Marble, "ipopt_scholtes": lambda: Ipopt(RELAXATIONS), "ipopt_products": lambda: Ipopt([0.0])}
