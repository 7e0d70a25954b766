"""Random calls of marble.lcs, valid and hostile ones, by seed; the answers are checked.

A call ends with a result that an independent check accepts, or with an error of this package that names one of its
arguments. Everything depends on the seed and the index of the call alone.

Usage: python tests/lcs_random.py [--runs N] [--seed S] [--first INDEX] [--target NAME ...]
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import faulthandler
import importlib.util
import pathlib
import re
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable, Iterator

import numpy as np

from marble.errors import Error, FailedPrecondition, InvalidArgument
from marble.lcs import LCS, Controller, ControlStep, Linearization, Plan, Planner, Task, c3_options, rollout
from marble.lcs.linearization import Settings, contact_pairs, friction_of
from marble.lcs.time_stepping import SmoothDynamics

PARTS = "ABDdEFHc"
HANGS_S = 300  # a call that takes longer ends the program with its stack


class Found(AssertionError):
    """A call that ended otherwise than it may."""


def hostile(random, like=None):
    """Something that is wrong nearly everywhere; like: an array, of which much may be kept."""
    shape = () if like is None else np.shape(like)
    kept = np.ones(shape) if like is None else np.array(like, dtype=float)
    entry = tuple(random.integers(size) for size in shape if size)

    def with_entry(value, dtype=float):
        made = kept.astype(dtype)
        if made.size:
            made[entry] = value
        return made

    choices = [
        lambda: None, lambda: with_entry(np.nan), lambda: with_entry(random.choice([-np.inf, np.inf])),
        lambda: with_entry(random.choice([-1, 1]) * 10.0 ** random.integers(100, 309)), lambda: kept.astype(complex),
        lambda: kept.astype(object), lambda: with_entry(None, object), lambda: with_entry("1", object),
        lambda: with_entry(10**400, object), lambda: kept.astype(str), lambda: kept.astype("datetime64[s]"),
        lambda: kept[..., None], lambda: kept[None], lambda: kept.ravel()[:-1], lambda: kept.T, lambda: -kept,
        lambda: np.zeros((0, *shape)), lambda: np.zeros((*shape, 0)), lambda: np.ma.masked_invalid(with_entry(np.nan)),
        lambda: np.broadcast_to(1.0, (2**20, 2**20, 2**15)), lambda: np.broadcast_to(1.0, (2**55,)),
        lambda: [[1.0], [1.0, 2.0]], lambda: {"a": 1}, lambda: {1.0, 2.0}, lambda: iter([1.0]), lambda: object(),
        lambda: "text", lambda: b"\0\xff", lambda: "", lambda: [], lambda: (), lambda: True, lambda: np.nan,
        lambda: -1, lambda: 0, lambda: 2**63, lambda: -(2**63) - 1, lambda: 10**400, lambda: 1e308, lambda: 5e-324,
        lambda: 1j, lambda: float, lambda: NotImplemented, lambda: lambda *_: 1 / 0, lambda: memoryview(b"1234"),
        lambda: np.float16(3), lambda: np.array("x"), lambda: np.zeros(2, [("a", float)]), lambda: np.timedelta64(1)]
    return choices[random.integers(len(choices))]()


def form(random, values):
    """The same numbers in another form."""
    array = np.array(values, dtype=float)
    return [array, array.tolist(), np.asfortranarray(array), array.astype(object),
            np.repeat(array, 2, axis=0)[::2] if array.ndim else array][random.integers(5)]


def system(random, sizes=None, stages=None):
    """The parts of an LCS. Mostly F makes each of its LCPs solvable."""
    nx, nu, nl = sizes or (random.integers(1, 5), random.integers(1, 4), random.integers(0, 5))
    scale = 10.0 ** random.uniform(-1, 1)
    shapes = {"A": (nx, nx), "B": (nx, nu), "D": (nx, nl), "d": (nx,), "E": (nl, nx), "F": (nl, nl), "H": (nl, nu),
              "c": (nl,)}
    made = {}
    for part in PARTS:
        per_stage = stages is not None and random.random() < 0.3
        values = scale * random.normal(size=(*((stages,) if per_stage else ()), *shapes[part]))
        if part == "A":
            values = 0.9 * values / scale / max(1.0, nx**0.5)
        if part == "F" and random.random() < 0.9:
            values = values @ values.swapaxes(-1, -2) / scale + 0.1 * np.eye(nl)
        made[part] = values
    return made


def array_of(value):
    """What hostile may keep: numbers in an array or a list."""
    try:
        return np.array(value, dtype=float) if np.ndim(value) else None
    except (TypeError, ValueError):
        return None


def spoil(random, arguments, count=1):
    """The arguments with some hostile ones among them."""
    made = dict(arguments)
    for name in random.choice(sorted(made), size=min(count, len(made)), replace=False):
        made[name] = hostile(random, array_of(made[name]))
    return made


@contextlib.contextmanager
def errors(*fields: str, state: bool = False) -> Iterator[None]:
    """Only errors that name one of these fields; with `state` also those of a state that does not fit."""
    try:
        yield
    except InvalidArgument as error:
        root = re.split(r"[.\[ ]", error.field)[0]
        if root not in fields:
            raise Found(f"{type(error).__name__} names {error.field!r}, not of {fields}: {error}") from error
        if len(str(error)) > 2000:
            raise Found(f"a text of {len(str(error))} letters: {str(error)[:200]}") from error
        raise
    except FailedPrecondition as error:
        if not state or not str(error):
            raise Found(f"FailedPrecondition: {error}") from error
        raise
    except Found:
        raise
    except BaseException as error:
        raise Found(f"{type(error).__name__}: {str(error)[:300]}") from error


def must_refuse(call):
    try:
        with errors(state=True):
            call()
    except FailedPrecondition:
        return
    raise Found("a call after the end of the session")


def near(left, right, scale, what):
    if not np.all(np.abs(left - right) <= 1e-5 * (1 + scale)):
        raise Found(f"{what}: off by {np.abs(left - right).max():g} at a scale of {scale:g}")


def check_plan(plan: Plan, lcs: LCS, x0, task, last_u) -> bool:
    """Dynamics, complementarity, bounds and objective by plain products; whether the plan is feasible."""
    N = task["stages"]
    if plan.x.shape != (N + 1, lcs.nx) or plan.u.shape != (N, lcs.nu) or plan.lam.shape != (N, lcs.nl):
        raise Found(f"shapes {plan.x.shape}, {plan.u.shape}, {plan.lam.shape}")
    if not plan.feasible:
        return False
    near(plan.x[0], x0, np.abs(x0).max(), "x0")
    for k in range(N):
        s, x, u, lam = lcs.stage(k), plan.x[k], plan.u[k], plan.lam[k]
        scale = max(np.abs(part).max(initial=0.0) for part in (
            *(s.A * x, s.B * u, s.D * lam), *(s.E * x, s.F * lam, s.H * u), s.c, s.d, lam, plan.x[k + 1]))
        near(s.A @ x + s.B @ u + s.D @ lam + s.d, plan.x[k + 1], scale, f"dynamics of stage {k}")
        near(np.minimum(lam, s.E @ x + s.F @ lam + s.H @ u + s.c), 0.0, scale, f"complementarity of stage {k}")
    change = np.diff(plan.u, axis=0, prepend=last_u[None])
    for what, values, low, high in (("u", plan.u, task["u_lb"], task["u_ub"]),
                                    ("x", plan.x[1:], -np.inf, task["x_ub"]),
                                    ("change", change, -task["max_u_change"], task["max_u_change"])):
        scale = np.abs(values).max()
        if (values < low - 1e-5 * (1 + scale)).any() or (values > high + 1e-5 * (1 + scale)).any():
            raise Found(f"{what} is out of its bounds")
    error, u = plan.x - task["x_ref"], plan.u - task["u_ref"]
    objective = sum(x @ task["Q"] @ x for x in error[:-1]) + sum(v @ task["R"] @ v for v in u) + (
        error[-1] @ task["P"] @ error[-1]) + task["regularization"] * np.square(plan.lam).sum() + sum(
            v @ task["R_change"] @ v for v in change)
    near(plan.objective, objective, abs(objective), "objective")
    if plan.objective > plan.start_objective + 1e-6 * (1 + abs(plan.start_objective)):
        raise Found(f"the objective {plan.objective:g} is above that of the start, {plan.start_objective:g}")
    return True


def problem(random, nx, nu):
    """The keyword arguments of Planner."""
    def positive(size):
        root = random.normal(size=(size, size))
        return root @ root.T + 0.1 * np.eye(size)

    width = 10.0 ** random.uniform(-1, 2)
    return {"stages": int(random.integers(1, 6)), "Q": positive(nx), "R": positive(nu), "P": positive(nx),
            "R_change": positive(nu) if random.random() < 0.5 else np.zeros((nu, nu)),
            "regularization": random.choice([0.0, 1e-6, 0.1]), "x_ref": random.normal(size=nx),
            "u_ref": random.normal(size=nu), "u_lb": -width, "u_ub": width,
            "x_ub": np.where(random.random(nx) < 0.2, 100.0, np.inf), "max_u_change": 2 * width}


def limits(random, task, nu):
    """Limits of a step: one row, or one per stage."""
    rows = (task["stages"], 1) if random.random() < 0.5 else (1,)
    width = task["u_ub"] * random.uniform(0.5, 1.5, size=(*rows[:-1], nu))
    return {"u_lb": -width, "u_ub": width, "x_ub": task["x_ub"] * random.uniform(0.5, 1.5, size=rows)}


# ---------------------------------------------------------------- targets: each makes one call or a few


def lcs(random):
    arguments = {**{part: form(random, values) for part, values in system(random, stages=3).items()}, "dt": 0.1,
                 "names": None}
    if random.random() < 0.9:
        arguments = spoil(random, arguments, random.integers(1, 3))
    with errors(*PARTS, "dt", "names"):
        made = LCS(**arguments)
    k = hostile(random) if random.random() < 0.3 else 0
    with errors("k"):
        made.stage(k)


def roll_out(random):
    parts = system(random, stages=random.choice([None, 4]))
    made = LCS(**parts)
    arguments = {"lcs": made, "x0": form(random, random.normal(size=made.nx)),
                 "u": form(random, random.normal(size=(made.stages or 4, made.nu)))}
    is_valid = random.random() < 0.4
    with errors("lcs", "x0", "u", "stages", state=True):
        x, lam = rollout(**(arguments if is_valid else spoil(random, arguments)))
    if is_valid:
        u = np.array(arguments["u"], dtype=float)
        for k in range(4):
            s = made.stage(k)
            gap = s.E @ x[k] + s.F @ lam[k] + s.H @ u[k] + s.c
            scale = max(np.abs(part).max(initial=0.0) for part in (s.F * lam[k], s.E * x[k], s.D * lam[k], x[k + 1]))
            near(np.minimum(gap, lam[k]), 0.0, scale, "complementarity of the roll-out")
            near(s.A @ x[k] + s.B @ u[k] + s.D @ lam[k] + s.d, x[k + 1], scale, "dynamics of the roll-out")


PLANNER = ("lcs", "stages", "Q", "R", "P", "R_change", "regularization", "x_ref", "u_ref", "x_lb", "x_ub", "u_lb",
           "u_ub", "max_u_change")


def planner(random):
    parts = system(random)
    made = LCS(**parts)
    arguments = {"lcs": made, **problem(random, made.nx, made.nu)}
    with errors(*PLANNER, state=True), Planner(**spoil(random, arguments, random.integers(1, 3)),
                                               server="local") as one, errors("x0", "lcs"):
        one.step(random.normal(size=made.nx))


def step(random):
    """A few steps, of which some are hostile and must change nothing."""
    made = LCS(**system(random))
    sizes, task = (made.nx, made.nu, made.nl), problem(random, made.nx, made.nu)
    N, now, feasible = task["stages"], made, 0
    last = np.zeros(made.nu)
    with Planner(made, **task, server="local") as one:
        for _ in range(4):
            x0 = random.normal(size=made.nx)
            if random.random() < 0.4:
                other = LCS(**system(random, sizes, N))
                now = other if other.stages in (None, N) else now
            arguments = {"x0": x0, "lcs": now, "x_ref": form(random, random.normal(size=(N + 1, made.nx))),
                         "u_ref": form(random, random.normal(size=(N, made.nu))), "last_u": last,
                         "u": form(random, random.normal(size=(N, made.nu))), "shift": random.integers(0, N + 1),
                         **limits(random, task, made.nu)}
            with contextlib.suppress(InvalidArgument, FailedPrecondition), errors(*arguments, "deadline", state=True):
                wrong = spoil(random, {**arguments, "deadline": None}, random.integers(1, 3))
                if random.random() < 0.3:
                    del wrong["x0"], wrong["last_u"], wrong["deadline"]
                    one.prepare(**wrong)
                else:
                    one.step(**wrong)
            plan = one.step(**arguments)
            targets = {name: np.array(arguments[name], dtype=float) for name in ("x_ref", "u_ref")}
            bounds = {name: arguments[name] for name in ("u_lb", "u_ub", "x_ub")}
            feasible += check_plan(plan, now, x0, {**task, **targets, **bounds}, last)
    must_refuse(lambda: one.step(np.zeros(made.nx)))
    return feasible


class Rod:
    """A mass before a wall, as a controller's model. Its states are (q, v)."""

    def __call__(self, state, u=None):
        return self.at(state, *self.measure(state), u)

    def at(self, state, q, v, u=None):
        parts = {"A": [[1, 0.1], [0, 1]], "B": [[0], [0.1]], "D": [[0.01], [0.1]], "d": [0, 0], "E": [[1, 0.1]],
                 "F": [[0.01]], "H": [[0]], "c": [1.0 + q[0]]}
        none = np.zeros((1, 1))
        smooth = SmoothDynamics(np.eye(1), none, np.zeros(1), none, none, np.eye(1), v, np.zeros(1), np.eye(1))
        return Linearization(LCS(**parts), q, v, np.zeros(1), (), np.zeros(0), smooth, np.array([-9.0]),
                             np.array([9.0]), lambda a, b: b - a, lambda a, b: a + b)

    def measure(self, state):
        if not isinstance(state, tuple) or len(state) != 2:
            raise InvalidArgument("state", "must be (q, v)")
        q, v = (np.array(one, dtype=float).reshape(1) for one in state)
        return q, v


TASK = {"rate": 10.0, "stages": 4, "dt": 0.1, "Q": np.eye(2), "R": np.eye(1), "P": np.eye(2), "R_change": np.eye(1),
        "regularization": 0.1, "u_ref": np.zeros(1), "u_lb": -1.0, "u_ub": 1.0, "v_lb": -9.0, "v_ub": 9.0,
        "max_u_change": 5.0, "contacts": {}, "shift": 1, "deadline": np.inf, "kp": 1.0, "kd": np.ones(1),
        "target": (np.zeros(1), np.zeros(1))}
OF_TASK = (*TASK, "x_lb", "x_ub", "x_ref", "x0", "task", "state", "elapsed", "model")


def task(random):
    """A task, and a controller of it, with a hostile call among its steps; it is closed then."""
    arguments = TASK if random.random() < 0.3 else spoil(random, TASK, random.integers(1, 3))
    if callable(arguments["target"]):  # its errors are its own
        arguments["target"] = None
    if random.random() < 0.2:
        parts = [hostile(random, np.zeros(1)) for _ in range(random.integers(4))]
        arguments = {**TASK, "target": (lambda *_: parts) if random.random() < 0.5 else parts}
    with errors(*OF_TASK, state=True):
        one = Task(**arguments)
        with Controller(Rod(), one, server="local") as controller:
            state = (random.normal(size=1), random.normal(size=1))
            if random.random() < 0.2:
                controller.prepare(state)
            for _ in range(2):
                made = controller.step(state)
                if not isinstance(made, ControlStep) or not np.isfinite(made.u).all() or np.abs(made.u).max() > 9:
                    raise Found(f"inputs {made.u}")
                if random.random() < 0.5:
                    controller.prepare(state)
                controller.input(state, hostile(random) if random.random() < 0.3 else 0.05)
                if random.random() < 0.3:
                    controller.reset(state)
        must_refuse(lambda: controller.step(state))


def threads(random):
    """Two threads at once, which is not allowed: errors, or plans, and no crash; afterwards one goes on."""
    made = LCS(**system(random))
    task, found = problem(random, made.nx, made.nu), []
    with Planner(made, **task, server="local") as one:
        states = [random.normal(size=made.nx) for _ in range(8)]

        def work(own):
            for x in own:
                try:
                    one.step(x)
                except Error:
                    pass
                except BaseException as error:
                    found.append(error)

        both = [threading.Thread(target=work, args=(own,)) for own in (states[:4], states[4:])]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()
        with errors("lcs", state=True):
            one.step(states[0], lcs=made)
    if found:
        raise Found(f"{type(found[0]).__name__}: {found[0]}") from found[0]


def settings(random):
    arguments = {"dt": 0.02, "contact": "anitescu", "num_directions": 2, "max_gap": 0.1, "stiffness": 100.0,
                 "joint_limits": False}
    is_valid = random.random() < 0.4
    with errors(*arguments):
        one = Settings.of(**(arguments if is_valid else spoil(random, arguments, random.integers(1, 3))))
    given = [("a", "b", "corner0"), ("a", "b", "corner1")]
    if random.random() < 0.6:
        given = hostile(random) if random.random() < 0.5 else [given[0], hostile(random), given[1]]
    with errors("pairs", "friction"):
        contact_pairs(one, given, list, lambda _: None, shape_of, lambda *_: ("corner0", "corner1"))
        friction_of(hostile(random, np.ones(2)) if random.random() < 0.6 else [0.1, 0.2], [0.5, 0.5])


def shape_of(given, index):
    if not isinstance(given, str):
        raise InvalidArgument("pairs", "must be names", index=index, value=repr(given)[:50])
    return given


MODEL = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 .1"/><body pos="0 0 .1">
  <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1" range="-1 1" limited="true"/>
  <geom name="box" type="box" size=".1 .1 .1"/></body></worldbody>
  <actuator><motor joint="x" ctrlrange="-1 1"/></actuator></mujoco>"""


def mujoco(random):
    """Options of the linearizer, with the library's own model."""
    import mujoco as mj

    mj.set_mju_user_warning(lambda _: None)  # of huge inputs; a file otherwise
    model = mj.MjModel.from_xml_string(MODEL)
    data = mj.MjData(model)
    arguments = {"model": model, "data": data, "u": np.zeros(1), "dt": 0.02, "contact": "stewart_trinkle",
                 "pairs": [("floor", "box", "corner0"), ("floor", "box", "corner4")], "max_gap": 0.1,
                 "num_directions": 2, "friction": np.array([0.5, 0.6]), "stiffness": None, "joint_limits": True,
                 "ignore": ()}
    from marble.lcs.mujoco import linearize

    with errors(*arguments, *PARTS):  # huge inputs make an LCS that is not finite
        now = linearize(**spoil(random, arguments, random.integers(0, 3)))
    with errors("q", "v", "x"):
        now.state(hostile(random, np.zeros(2)), np.zeros(2))
        now.configuration(hostile(random, np.zeros(4)))


C3 = """contact_model: anitescu
num_contacts: 2
mu: [0.4, 0.5]
num_friction_directions: 1
contact_pair_configs: []
N: 5
dt: 0.1
gamma: 0.9
w_Q: 50
w_R: 1e-3
admm_iter: 3
q_vector: [1, 1, 1, 1]
r_vector: [1, 1, 1]
u_horizontal_limits: [-10, 12]
publish_frequency: 50
"""
TOKENS = ("[", "]", "{", "}", ":", "- ", ",", "\n", "&a ", "*a", "<<: ", "!!int ", "!", "'", '"', "|", "? ", "---\n",
          "\t", "null", ".nan", ".inf", "-.inf", "true", "1e-3", "-1", "0x_", "2001-99-99", "9" * 400, "#", "%", "\x00",
          "é", "c3_options: ", "\ufeff", "=", "0o9", "1:2:99", " " * 40, "[" * 30, "quaternion_weight: 1\n")


def options(random):
    """C3's options with lines dropped, moved and spoiled."""
    lines = C3.splitlines(keepends=True)
    for _ in range(random.integers(0, 4)):
        at, other = random.integers(len(lines), size=2)
        line, kind = lines[at], random.integers(5)
        place = random.integers(len(line) + 1)
        token = TOKENS[random.integers(len(TOKENS))]
        lines[at] = (line[:place] + token + line[place:], f"{line.partition(':')[0]}: {token}\n", "", lines[other],
                     line[:place] + line[place + 1:])[kind]
    names = "|".join(re.findall(r"^\w+", C3, re.M)).split("|")
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "options.yaml"
        path.write_text("".join(lines), encoding="utf-8")
        try:
            with errors(*names, "path"):
                made = c3_options(path)
        except Found as found:
            cause = found.__cause__
            if isinstance(cause, InvalidArgument) and "is not a field of C3's options" in str(cause):
                raise cause from None
            if isinstance(cause, InvalidArgument) and cause.field.startswith(("quaternion_weight", "c3_options")):
                raise cause from None
            raise
    costs = np.concatenate([np.diagonal(W, axis1=-2, axis2=-1).ravel() for W in (made.Q, made.R, made.P)])
    if not (np.isfinite(costs) & (costs >= 0)).all() or not made.dt > 0 or made.stages < 1:
        raise Found("options that are no options")
    with errors(*OF_TASK, "pairs", "q_vector", "quaternions"):
        made.task((np.zeros(2), np.zeros(2)), pairs=[("a", "b"), ("a", "c")],
                  quaternions=hostile(random) if random.random() < 0.5 else ())


TARGETS: dict[str, Callable] = {one.__name__: one for one in (
    lcs, roll_out, planner, step, task, threads, settings, options)}
WEIGHTS = {"lcs": 5, "roll_out": 3, "planner": 3, "step": 3, "task": 3, "threads": 0.3, "settings": 2, "options": 3,
           "mujoco": 1}
if importlib.util.find_spec("mujoco") is not None:
    TARGETS["mujoco"] = mujoco
if importlib.util.find_spec("yaml") is None:
    del TARGETS["options"]


def call(seed: int, index: int, targets: list[str]) -> tuple[str, str, int]:
    """The target, "accepted" or "refused", and the number of feasible plans that were checked."""
    random = np.random.default_rng([seed, index])
    targets = sorted(targets)
    weights = np.array([WEIGHTS[name] for name in targets])
    target = str(random.choice(targets, p=weights / weights.sum()))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return target, "accepted", TARGETS[target](random) or 0
    except (InvalidArgument, FailedPrecondition):
        return target, "refused", 0
    except Exception as error:
        raise Found(f"{target}, seed {seed}, index {index}: {error}") from error


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, metavar="INDEX")
    parser.add_argument("--target", nargs="*", choices=sorted(TARGETS), default=sorted(TARGETS))
    wanted = parser.parse_args()
    counts: collections.Counter = collections.Counter()
    kinds: dict[str, str] = {}
    for index in range(wanted.first, wanted.first + wanted.runs):
        faulthandler.dump_traceback_later(HANGS_S, exit=True)
        try:
            target, outcome, plans = call(wanted.seed, index, wanted.target)
            counts[target, outcome] += 1
            counts["plans", "checked"] += plans
        except Found as found:
            counts["found", ""] += 1
            kinds.setdefault(re.sub(r"\d+", "#", str(found))[:120], str(found))
    faulthandler.cancel_dump_traceback_later()
    for (name, outcome), count in sorted(counts.items()):
        print(f"{name:<12}{outcome:<10}{count:>8}")
    print("\n".join(kinds.values()))
    return 1 if kinds else 0


if __name__ == "__main__":
    sys.exit(main())
