"""The controllers by name, with the options that tuning chose for each task."""

import importlib.util
import itertools

import consensus
import ilqr
import planners

# compare --tune: the lowest sum of costs over seeds 1 and 3; of C3+ on the hopper over hopper_stand and hopper_push.
# What is not here is the default of the options.
WEIGHTS = {"g_lambda": (0.001, 0.01, 0.1, 1.0), "rho_scale": (2.0, 3.0)}
GRIDS = {"c3": WEIGHTS, "c3plus": {**WEIGHTS, "u_eta": (0.01, 1.0, 100.0)},
         "ilqr": {"iterations": (1, 3), "timestep": (0.01, 0.005)}}
TUNED: dict[tuple[str, str], dict] = {  # by controller and model
    ("c3", "cart_pole"): {"g_lambda": 0.1, "rho_scale": 3.0},
    ("c3", "hopper"): {"g_lambda": 1.0, "rho_scale": 3.0},
    ("c3plus", "cart_pole"): {"g_lambda": 0.1, "rho_scale": 3.0, "u_eta": 100.0},
    ("c3plus", "push_box"): {"g_lambda": 0.01, "rho_scale": 2.0, "u_eta": 0.01},
    ("c3plus", "push_t"): {"g_lambda": 0.01, "rho_scale": 2.0, "u_eta": 0.01},  # these two: six combinations on seed 1
    ("c3plus", "pivot"): {"g_lambda": 0.01, "rho_scale": 2.0, "u_eta": 1.0},
    ("c3plus", "hopper"): {"g_lambda": 1.0, "rho_scale": 2.0, "u_eta": 1.0},
    ("c3plus", "quadruped"): {"g_lambda": 0.01, "rho_scale": 2.0, "u_eta": 1.0},
    ("ilqr", "cart_pole"): {"iterations": 1, "timestep": 0.005},
    ("ilqr", "hopper"): {"iterations": 1, "timestep": 0.01},
}


def family(name):
    """The controller whose tuning it shares: the solver of the QPs has its own name only."""
    return name.removesuffix("_kkt")


def peer(name, task, given):
    """A peer's options: the published ones, those that tuning chose, and those given."""
    chosen = {**TUNED.get((family(name), task.model), {}), **given}
    if name == "ilqr":
        return ilqr.Options(**chosen)
    if "g_lambda" in chosen:  # one penalty for all copies
        chosen = {"g_x": chosen["g_lambda"], "g_eta": chosen["g_lambda"], **chosen}
    return consensus.Options(plus="plus" in name, qp="kkt" if name.endswith("_kkt") else "osqp", **chosen)


def controller(name, task, given=None, dump=None):
    """What loop.run calls. given: options of a peer or of Marble's solver; dump: as planners.Marble has it."""
    if name == "none":
        return planners.Nothing
    if name == "marble":
        return planners.Marble(given or {}, dump)
    options = peer(name, task, given or {})
    if name == "ilqr":
        return lambda task, model, view: ilqr.Ilqr(task, options, model, view)
    return lambda task, _, view: consensus.Consensus(task, options, view)


def missing(name, pairs):
    """Why a controller has to be left out of a task with that many pairs a stage; empty if it does not."""
    if name in ("c3", "c3plus") and importlib.util.find_spec("osqp") is None:
        return "osqp is not installed"
    if family(name) == "c3" and 3**pairs > consensus.MAX_FACES:
        return f"its exact projection has 3^{pairs} faces a stage"
    return ""


def grid(name):
    """All combinations of a controller's grid, as options."""
    values = GRIDS[family(name)]
    return [dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]


NAMES = ("none", "marble", "c3", "c3_kkt", "c3plus", "c3plus_kkt", "ilqr")
