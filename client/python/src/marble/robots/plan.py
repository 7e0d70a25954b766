"""A robot's plan as formulas: a nonlinear problem with pairs, begun from an LCQP's answer, solved and checked."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import marble
from marble.base.lazy import lazy
from marble.errors import Unavailable
from marble.model.lcqp import Vector
from marble.model.solution import Solution
from marble.nlp import Answer, Iteration

sp: Any = lazy("scipy.sparse")

Tables = Mapping[str, NDArray[np.float64]]
"""The variables of a plan by name: a row a step."""


def casadi() -> Any:
    """The module; Unavailable where it is not installed."""
    try:
        return importlib.import_module("casadi")
    except ImportError:
        raise Unavailable("this plan is made of CasADi's formulas: pip install casadi") from None


@dataclass(frozen=True)
class Scene:
    """What there is to draw, as lines of points in a plane.

    fixed: what does not move. path: a point a step. bodies: the lines of the robot, step by step. marks: the places
    where something happens.
    """

    fixed: Sequence[NDArray[np.float64]]
    path: NDArray[np.float64]
    bodies: Sequence[Sequence[NDArray[np.float64]]]
    marks: NDArray[np.float64]
    axes: tuple[str, str]


@dataclass(frozen=True)
class Robot:
    """What is to be planned: min f(x) s.t. g(x) in its bounds, x in its own, 0 ≤ G(x) ⊥ H(x) ≥ 0.

    problem: CasADi expressions, as `marble.nlp.solve_casadi` takes them. guess: what the formulas are linearised at.
    parts: where in x the rows of each table are: first entry, steps, numbers a step. step_s: seconds from one row to
    the next. scene: what a plan looks like.
    """

    name: str
    step_s: float
    problem: Mapping[str, Any]
    guess: Vector
    lbx: Vector
    ubx: Vector
    lbg: Vector
    ubg: Vector
    parts: Mapping[str, tuple[int, int, int]]
    scene: Callable[[Tables], Scene]

    def tables(self, x: Vector) -> Tables:
        """The variables by name."""
        return {name: np.asarray(x)[first:first + steps * size].reshape(steps, size)
                for name, (first, steps, size) in self.parts.items()}

    def linearised(self) -> marble.LCQP:
        """The LCQP of the formulas' tangents at the guess, with the objective's curvature there."""
        ca, p = casadi(), self.problem
        x, at = p["x"], self.guess

        def tangent(of: Any) -> tuple[Any, Vector]:
            J, value = ca.Function("tangent", [x], [ca.jacobian(of, x), of])(at)
            J = sp.csc_matrix(J.sparse())
            return J, np.asarray(value).reshape(-1) - J @ at

        Q = sp.csc_matrix(ca.Function("curvature", [x], [ca.hessian(p["f"], x)[0]])(at).sparse())
        slope, value = ca.Function("slope", [x], [ca.gradient(p["f"], x), p["f"]])(at)
        g = np.asarray(slope).reshape(-1) - Q @ at
        J, offset = tangent(p["g"])
        equal = self.lbg == self.ubg
        above, below = ~equal & np.isfinite(self.lbg), ~equal & np.isfinite(self.ubg)
        one = sp.identity(at.size, format="csr")
        low, high = np.isfinite(self.lbx), np.isfinite(self.ubx)
        (L, l), (R, r) = tangent(p["G"]), tangent(p["H"])
        J = J.tocsr()
        C = sp.vstack([J[above], -J[below], one[low], -one[high]], format="csc")
        d = [offset[above] - self.lbg[above], self.ubg[below] - offset[below], -self.lbx[low], self.ubx[high]]
        c0 = float(value) - float(g @ at) - 0.5 * float(at @ (Q @ at))
        return marble.LCQP(Q, g, A=J[equal].tocsc(), b=offset[equal] - self.lbg[equal], C=C, d=np.concatenate(d), L=L,
                           l=l, R=R, r=r, c0=c0, name=self.name)

    def violation(self, x: Vector) -> float:
        """The largest violation of a row, a bound or a pair at x, by the formulas alone."""
        ca, p = casadi(), self.problem
        g, G, H = (np.asarray(part).reshape(-1) for part in ca.Function("at", [p["x"]], [p["g"], p["G"], p["H"]])(x))
        amounts = [self.lbg - g, g - self.ubg, self.lbx - x, x - self.ubx, np.abs(np.minimum(G, H))]
        return float(max(part.max(initial=0.0) for part in amounts))


@dataclass(frozen=True)
class Plan:
    """What came of it. start: the LCQP's answer. answer: the nonlinear one. tables: its x by name."""

    robot: Robot
    start: Solution
    answer: Answer
    tables: Tables

    def __str__(self) -> str:
        stationary = "yes" if self.answer.b_stationary else "not known"
        return (f"{self.robot.name}: {self.answer.status.value}\n"
                f"  size          {self.robot.guess.size} variables, {self.robot.lbg.size} rows, "
                f"{self.answer.xi.size} pairs\n"
                f"  objective     {self.answer.objective:.6g}; {self.start.objective:.6g} of the LCQP it began at\n"
                f"  violation     {self.robot.violation(self.answer.x):.1e}\n"
                f"  B-stationary  {stationary}\n"
                f"  work          {self.answer.ticks} LCQPs after the first, {self.answer.iterations} iterations, "
                f"{self.answer.factorizations} factorizations")


def solve(robot: Robot, *, from_guess: bool = False, step_tolerance: float = 1e-6,
          server: str | marble.Client | None = None, progress: Callable[[Iteration], object] | None = None,
          **settings: Any) -> Plan:
    """Plans: the LCQP at the guess first, then from its answer, or from the guess itself, the nonlinear problem.

    step_tolerance: a plan that moves by less is at its end: a micrometre. settings: as `marble.nlp.solve` takes them.
    """
    first = robot.linearised()
    start = server.solve(first) if isinstance(server, marble.Client) else marble.solve(first, server=server)
    answer = marble.nlp.solve_casadi(
        robot.problem, robot.guess if from_guess else np.clip(start.z, robot.lbx, robot.ubx), lbx=robot.lbx,
        ubx=robot.ubx, lbg=robot.lbg, ubg=robot.ubg, step_tolerance=step_tolerance, server=server, progress=progress,
        **settings)
    return Plan(robot, start, answer, robot.tables(answer.x))


@dataclass
class Formulas:
    """Collects variables, rows, pairs and squares of a plan."""

    name: str
    step_s: float
    _x: list[Any] = field(default_factory=list)
    _numbers: dict[str, list[float]] = field(default_factory=lambda: {"guess": [], "lbx": [], "ubx": []})
    _parts: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    _rows: list[Any] = field(default_factory=list)
    _highest: list[float] = field(default_factory=list)
    _pairs: list[tuple[Any, Any]] = field(default_factory=list)
    _cost: Any = 0

    def table(self, name: str, steps: int, lower: Sequence[float], upper: Sequence[float], guess: ArrayLike) -> Any:
        """New variables: a row a step, each number within its bounds; one row of `guess`, or one a step."""
        ca, size = casadi(), len(lower)
        self._parts[name] = (len(self._numbers["guess"]), steps, size)
        made = ca.SX.sym(name, size, steps)
        self._x.append(ca.vec(made))
        for key, values in (("guess", guess), ("lbx", lower), ("ubx", upper)):
            self._numbers[key] += np.broadcast_to(np.asarray(values, dtype=np.float64), (steps, size)).ravel().tolist()
        return made.T

    def zero(self, *rows: Any) -> None:
        """Each is 0."""
        for row in rows:
            self._rows.append(row)
            self._highest += [0.0] * row.numel()

    def positive(self, *rows: Any) -> None:
        """Each is at least 0."""
        for row in rows:
            self._rows.append(row)
            self._highest += [np.inf] * row.numel()

    def pair(self, G: Any, H: Any) -> None:
        """0 ≤ G ⊥ H ≥ 0."""
        self._pairs.append((G, H))

    def square(self, weight: float, of: Any) -> None:
        """Adds ½ weight · the sum of squares to the cost."""
        self._cost = self._cost + 0.5 * weight * casadi().sumsqr(of)

    def robot(self, scene: Callable[[Tables], Scene]) -> Robot:
        """All of it."""
        ca = casadi()

        def column(expressions: list[Any]) -> Any:
            return ca.vertcat(*(ca.vec(part) for part in expressions))

        G, H = zip(*self._pairs, strict=True)
        problem = {"x": column(self._x), "f": self._cost, "g": column(self._rows), "G": column(list(G)),
                   "H": column(list(H))}
        numbers = {key: np.array(values) for key, values in self._numbers.items()}
        highest = np.array(self._highest)
        return Robot(self.name, self.step_s, problem, lbg=np.zeros(highest.size), ubg=highest, parts=self._parts,
                     scene=scene, **numbers)
