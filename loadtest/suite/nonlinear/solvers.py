"""What is asked to solve the problems: marble, and others where they are installed.

Each takes a problem and returns whether it says that it is solved, x, and how much work that was.
"""

import importlib.util

import numpy as np

SMALLEST = 1e-9  # t of the last relaxation
RELAXATIONS = [10.0**-k for k in range(10)]


def rows(problem, x, exp):
    """The parts of a problem, all of them there."""
    return {"equalities": [], "inequalities": [], "G": [], "H": [], **problem.parts(list(x), exp)}


class InCasadi:
    """A problem as CasADi's expressions."""

    def __init__(self, problem):
        import casadi as ca

        self.x = ca.SX.sym("x", len(problem.start))
        at = rows(problem, ca.vertsplit(self.x), ca.exp)
        self.f = at["f"]
        self.parts = {name: ca.vertcat(*at[name]) if at[name] else ca.SX(0, 1)
                      for name in ("equalities", "inequalities", "G", "H")}

    def function(self, *parts):
        """Of x, dense."""
        import casadi as ca

        made = ca.Function("parts", [self.x], [ca.densify(part) for part in parts])
        return lambda x: [np.asarray(value) for value in made.call([np.asarray(x, dtype=float)])]


class Marble:
    """marble.nlp.solve_casadi, as it comes. Work: LCQPs."""

    def __call__(self, problem):
        import casadi as ca

        import marble

        given = InCasadi(problem)
        E, I = given.parts["equalities"], given.parts["inequalities"]
        lower, upper = problem.bounds
        answer = marble.nlp.solve_casadi(
            {"x": given.x, "f": given.f, "g": ca.vertcat(E, I), "G": given.parts["G"], "H": given.parts["H"]},
            problem.start, lbx=lower, ubx=upper, lbg=0, ubg=[0.0] * E.numel() + [np.inf] * I.numel())
        return answer.status.value == "solved", answer.x, answer.ticks


class Ipopt:
    """IPOPT by CasADi, G H <= t with t from 1 by 0.1 to 1e-9, each from the answer before. Work: IPOPT's iterations."""

    def __init__(self):
        import casadi  # noqa: F401

    def __call__(self, problem):
        import casadi as ca

        given, t = InCasadi(problem), ca.SX.sym("t")
        E, I, G, H = given.parts.values()
        g = ca.vertcat(E, I, G, H, G * H - t)
        free, pairs = I.numel() + 2 * G.numel(), G.numel()
        quiet = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "ipopt.tol": 1e-9,
                 "ipopt.constr_viol_tol": 1e-9, "ipopt.bound_relax_factor": 0.0, "ipopt.warm_start_init_point": "yes",
                 "ipopt.max_iter": 1000}
        solver = ca.nlpsol("scholtes", "ipopt", {"x": given.x, "p": t, "f": given.f, "g": g}, quiet)
        lower, upper = problem.bounds
        x, multipliers, iterations, well = problem.start, {}, 0, False
        for now in RELAXATIONS:
            answer = solver(x0=x, p=now, lbx=lower, ubx=upper, **multipliers,
                            lbg=[0.0] * (E.numel() + free) + [-np.inf] * pairs,
                            ubg=[0.0] * E.numel() + [np.inf] * free + [0.0] * pairs)
            stats = solver.stats()
            iterations, well = iterations + stats["iter_count"], stats["success"]
            if well or now == RELAXATIONS[-1]:
                x, multipliers = answer["x"], {"lam_x0": answer["lam_x"], "lam_g0": answer["lam_g"]}
        return well, np.asarray(x).ravel(), iterations


class Snopt:
    """SNOPT by Drake; a pair is Drake's linear complementarity of two slacks. Work: not reported."""

    def __init__(self):
        from pydrake.solvers import SnoptSolver

        if not (SnoptSolver().available() and SnoptSolver().enabled()):
            raise ImportError("Drake without SNOPT")

    def __call__(self, problem):
        from pydrake import math as dm
        from pydrake.autodiffutils import AutoDiffXd
        from pydrake.solvers import MathematicalProgram, SnoptSolver

        def exp(value):
            return dm.exp(value) if isinstance(value, AutoDiffXd) else np.exp(value)

        prog = MathematicalProgram()
        x = prog.NewContinuousVariables(len(problem.start), "x")
        lower, upper = (np.array(bound, dtype=float) for bound in problem.bounds)
        prog.AddBoundingBoxConstraint(lower, upper, x)
        prog.AddCost(lambda v: rows(problem, v, exp)["f"] + 0 * v[0], vars=x)
        at = rows(problem, np.array(problem.start, dtype=float), np.exp)

        def add(name, high):
            if at[name]:
                prog.AddConstraint(lambda v: np.array([each + 0 * v[0] for each in rows(problem, v, exp)[name]]),
                                   lb=np.zeros(len(at[name])), ub=np.full(len(at[name]), high), vars=x)

        add("equalities", 0.0)
        add("inequalities", np.inf)
        pairs = len(at["G"])
        slack = prog.NewContinuousVariables(2 * pairs, "s")
        prog.AddConstraint(
            lambda v: np.array([each - s for each, s in
                                zip((lambda r: r["G"] + r["H"])(rows(problem, v[:len(x)], exp)), v[len(x):],
                                    strict=True)]),
            lb=np.zeros(2 * pairs), ub=np.zeros(2 * pairs), vars=np.concatenate([x, slack]))
        for i in range(pairs):
            prog.AddLinearComplementarityConstraint(np.array([[0.0, 1.0], [0.0, 0.0]]), np.zeros(2),
                                                    slack[[i, pairs + i]])
        guess = np.concatenate([problem.start, np.maximum(0.0, [float(v) for v in at["G"] + at["H"]])])
        answer = SnoptSolver().Solve(prog, guess, None)
        return answer.is_success(), answer.GetSolution(x), 0


class Pympcc:
    """pympcc, by its default strategy, Scholtes' relaxation, over cyipopt, with CasADi's derivatives. Work: not reported."""

    def __init__(self):
        import cyipopt  # noqa: F401
        import pympcc  # noqa: F401

    def __call__(self, problem):
        import casadi as ca
        import pympcc

        given = InCasadi(problem)

        def both(part):
            value, slope = given.function(part), given.function(ca.jacobian(part, given.x))
            return lambda x: value(x)[0].ravel(), lambda x: slope(x)[0]

        E, I, G, H = given.parts.values()
        f, slope = both(given.f)
        more = {}
        if E.numel():
            more["eq_constraints"], more["eq_jacobian"] = both(E)
        if I.numel():
            more["ineq_constraints"], more["ineq_jacobian"] = both(-I)
        (g_value, g_slope), (h_value, h_slope) = both(G), both(H)
        lower, upper = (np.array(bound, dtype=float) for bound in problem.bounds)
        made = pympcc.MPCCProblem(
            n=len(problem.start), n_comp=G.numel(), x0=np.array(problem.start, dtype=float), xl=lower, xu=upper,
            objective=lambda x: float(f(x)[0]), gradient=lambda x: slope(x).ravel(), comp_G=g_value,
            comp_G_jacobian=g_slope, comp_H=h_value, comp_H_jacobian=h_slope, n_eq=E.numel(), n_ineq=I.numel(), **more)
        answer = pympcc.solve(made, ipopt_options={"print_level": 0}, time_limit=30)
        return bool(answer.success), np.asarray(answer.x), 0


class Discopt:
    """discopt's solve_mpec, Scholtes' relaxation to 1e-9, with its own derivatives. Work: not reported."""

    def __init__(self):
        import discopt.mpec  # noqa: F401

    def __call__(self, problem):
        import discopt.modeling.core as dm
        from discopt.mpec import complementarity, solve_mpec

        model = dm.Model("problem")
        x = [model.continuous(f"x{i}", lb=max(low, -1e6), ub=min(high, 1e6))
             for i, (low, high) in enumerate(zip(*problem.bounds, strict=True))]
        at = rows(problem, x, dm.exp)
        model.minimize(at["f"])
        for row in at["equalities"]:
            model.subject_to(row == 0)
        for row in at["inequalities"]:
            model.subject_to(row >= 0)
        pairs = [complementarity(G + 0 * x[0], H + 0 * x[0], name=f"pair{i}")
                 for i, (G, H) in enumerate(zip(at["G"], at["H"], strict=True))]
        answer = solve_mpec(model, pairs, t_min=SMALLEST, x0=np.array(problem.start, dtype=float))
        status = str(getattr(answer.status, "value", answer.status)).lower()
        return "optimal" in status and "in" not in status[:2], np.asarray(answer.x, dtype=float).ravel(), 0


class Nosnoc:
    """nosnoc plans for systems that switch; it has no way to hand it a problem with pairs."""

    def __init__(self):
        if importlib.util.find_spec("nosnoc") is None:
            raise ImportError("No module named 'nosnoc'")
        raise ImportError("it takes Filippov systems, not problems with pairs")


SOLVERS = {"marble": Marble, "ipopt": Ipopt, "snopt": Snopt, "pympcc": Pympcc, "discopt": Discopt, "nosnoc": Nosnoc}
