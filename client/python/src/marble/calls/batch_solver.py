"""Many problems that differ only in their numbers: one pattern, numpy arrays in and out, in this process."""

from __future__ import annotations

import contextlib
import re
import threading
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.checks import is_whole
from marble.base.tables import VECTORS, Status
from marble.errors import Index, InvalidArgument, InvalidProblem
from marble.in_process import core, core_errors, under_way
from marble.message import requests
from marble.message.request import core_options
from marble.model.lcqp import LCQP, Vector
from marble.model.problem import Problem, compiled

_MOST_THREADS: Final = 256
_NAMES: Final = {"initial_z": "z0"}
_MULTIPLIERS: Final = ("y", "nu", "xi", "eta")


class BatchResult:
    """The answers to a batch of n elements, element after element, in the user's units.

    status_codes: (n,) integers, positions in `statuses`. z: (n, variables). objective: (n,). violations: (n, 3), the
    largest of equalities, inequalities and pairs, as in Solution. kkt_residual: (n,), as in Solution. factorizations:
    (n,) integers. y, nu, xi, eta: (n, rows), or None unless multipliers were requested. solve_s: seconds of the batch.

    An element that time_limit_s or Ctrl-C ended early says so in its status: it has its best point then, or NaN and no
    factorizations if it was not reached.
    """

    statuses: tuple[Status, ...]
    """What the codes mean."""

    def __init__(self, values: Mapping[str, Any], problem: LCQP, count: int, multipliers: bool) -> None:
        def table(name: str, columns: int) -> Vector:
            return np.asarray(values[name], dtype=np.float64).reshape(count, columns)

        sizes = {"y": problem.b.size, "nu": problem.d.size, "xi": problem.l.size, "eta": problem.r.size}
        self.statuses = tuple(Status(name) for name in core().statuses)
        self.status_codes: NDArray[np.int32] = np.frombuffer(values["status"], dtype=np.int32)
        self.factorizations: NDArray[np.int32] = np.frombuffer(values["factorizations"], dtype=np.int32)
        self.z = table("z", problem.n)
        self.objective = table("objective", 1).reshape(count)
        self.violations = table("violations", 3)
        self.kkt_residual = table("kkt_residual", 1).reshape(count)
        made = {name: table(name, size) if multipliers else None for name, size in sizes.items()}
        self.y, self.nu, self.xi, self.eta = (made[name] for name in _MULTIPLIERS)
        self.solve_s: float = values["solve_s"]

    def __len__(self) -> int:
        return int(self.status_codes.size)

    def __repr__(self) -> str:
        return f"<BatchResult: {int(self.solved.sum())} of {len(self)} solved in {self.solve_s:.3g} s>"

    @property
    def status(self) -> NDArray[np.object_]:
        """(n,) of marble.Status."""
        names = np.empty(len(self.statuses), dtype=object)
        names[:] = self.statuses
        result: NDArray[np.object_] = names[self.status_codes]
        return result

    @property
    def solved(self) -> NDArray[np.bool_]:
        """(n,): whether the tolerances, or the reduced ones, are met."""
        codes = [self.statuses.index(kind) for kind in (Status.SOLVED, Status.ALMOST_SOLVED)]
        result: NDArray[np.bool_] = np.isin(self.status_codes, codes)
        return result


class BatchSolver:
    """Solves many problems of one pattern, which is scaled, ordered and analysed once, in this process.

    problem: an LCQP or a Problem with the pattern, and with the numbers of the parts that a batch does not give.
    options, or any option by its name, as in marble.solve; time_limit_s is that of a whole batch. explain must be off.

    Where an element starts depends only on the numbers of its batch: a few are solved cold, the others start from the
    branches of the nearest solved ones. The answers are the same to the last bit on any number of threads. Of
    cart-poles, hoppers and small problems at least 99 in 100 are no higher than a solve of each by itself; of random
    problems with 30 pairs 94, and 4 are lower. With global_search, num_starts above 1, another path than fast, or
    polish=False every element is solved cold. One thread at a time may use it.

    Raises InvalidProblem and the other exceptions of marble.errors; Unavailable in a package without marble._core.
    """

    def __init__(self, problem: LCQP | Problem, *, options: Mapping[str, Any] | None = None,
                 **more_options: Any) -> None:
        self.problem = compiled(problem)
        self._turn = threading.Lock()
        with core_errors():
            self._core = core().Batches(self.problem, core_options(requests.merged(options, more_options)))

    @property
    def memory_bytes(self) -> int:
        """The estimated memory of all threads' solvers, in bytes."""
        return int(self._core.memory_bytes)

    def solve(self, *, c0: ArrayLike | None = None, g: ArrayLike | None = None, b: ArrayLike | None = None,
              d: ArrayLike | None = None, l: ArrayLike | None = None, r: ArrayLike | None = None,
              Q: ArrayLike | None = None, A: ArrayLike | None = None, C: ArrayLike | None = None,
              L: ArrayLike | None = None, R: ArrayLike | None = None, z0: ArrayLike | None = None,
              count: int | None = None, threads: int | None = None, multipliers: bool = False,
              start: BatchResult | None = None) -> BatchResult:
        """Solves n elements; the GIL is released, and Ctrl-C ends the batch.

        c0: (n,). g, b, d, l, r: (n, entries). Q, A, C, L, R: (n, stored entries), the values in the order of
        `solver.problem.A.data`; of Q those of its upper triangle. z0: (n, variables), where each element begins: if it
        is feasible, the answer is not above that of its branch. Parts that are not given keep the problem's numbers.
        C-contiguous float64 arrays are used in place; others are converted.

        count: n, at most 100 million; by default the first axis of the arrays, with which it must agree.
        threads: in [1, 256]; None: one for each processor. multipliers: also returns y, nu, xi and eta.
        start: a result of n elements of this solver with multipliers: each element starts from its own solution there.

        Raises InvalidProblem, before anything is solved: of the field "g" with the index (12, 3) where number 3 of
        element 12 is not finite.
        """
        given = {"c0": c0, "g": g, "b": b, "d": d, "l": l, "r": r, "Q": Q, "A": A, "C": C, "L": L, "R": R, "z0": z0}
        arrays = {name: self._table(values, name) for name, values in given.items() if values is not None}
        n = _count(arrays, count)
        if threads is not None and not is_whole(threads, 1, _MOST_THREADS):
            raise InvalidArgument("threads", f"must be None or a whole number in [1, {_MOST_THREADS}]", value=threads)
        first = None if start is None else self._first(start, n)
        if "c0" in arrays:
            arrays["c0s"] = arrays.pop("c0")
        if not self._turn.acquire(blocking=False):
            raise InvalidArgument("solve", "must not be called while another thread is in it")
        try:
            stop = core().Stop()
            with _errors(), under_way(stop):
                values = self._core.solve(n, arrays, int(threads or 0), bool(multipliers), first, stop,
                                          threading.current_thread() is threading.main_thread())
        finally:
            self._turn.release()
        return BatchResult(values, self.problem, n, bool(multipliers))

    def _table(self, values: ArrayLike, name: str) -> Vector:
        """Finite or not: the solver checks that. Not copied if it need not be."""
        table = np.asanyarray(values)
        if table.dtype.kind not in "biuf" or isinstance(table, np.ma.MaskedArray):
            raise InvalidProblem(name, "must be an array of real numbers", value=f"of type {table.dtype}")
        if name == "c0":
            if table.ndim != 1:
                raise InvalidProblem(name, "must have the shape (n,)", value=f"of shape {table.shape}")
        else:
            size = self._size(name)
            if table.ndim != 2 or table.shape[1] != size:
                raise InvalidProblem(name, f"must have the shape (n, {size})", value=f"of shape {table.shape}")
        try:
            return np.ascontiguousarray(table, dtype=np.float64)
        except MemoryError:
            raise InvalidProblem(name, "must fit into memory", value=f"of shape {table.shape}") from None

    def _size(self, name: str) -> int:
        if name == "z0":
            return self.problem.n
        part = getattr(self.problem, name)
        return int(part.size if name in VECTORS else part.nnz)

    def _first(self, start: BatchResult, n: int) -> tuple[Any, ...]:
        if not isinstance(start, BatchResult):
            raise InvalidArgument("start", "must be a BatchResult", value=type(start).__name__)
        if len(start) != n:
            raise InvalidArgument("start", f"must have {n} elements, as many as the batch", value=len(start))
        vectors = [getattr(start, name) for name in _MULTIPLIERS]
        if any(vector is None for vector in vectors):
            raise InvalidArgument("start", "must be a result of solve(multipliers=True)")
        sizes = (self.problem.n, self.problem.b.size, self.problem.d.size, self.problem.l.size, self.problem.r.size)
        if tuple(vector.shape[1] for vector in (start.z, *vectors)) != sizes:
            raise InvalidArgument("start", "must be a result for this pattern")
        return (start.status_codes, start.z, *vectors)


@contextlib.contextmanager
def _errors() -> Iterator[None]:
    """With the index in the array that was given where the core names an element and the index in that."""
    try:
        with core_errors():
            yield
    except InvalidArgument as error:
        element = re.fullmatch(r"([A-Za-z]\w*)(?:\.values)?\[(\d+)\]", error.field)
        if element is None:
            raise
        name, at = _NAMES.get(element[1], element[1]), int(element[2])
        index: Index = (at, error.index) if name != "c0" and isinstance(error.index, int) else at
        raise InvalidProblem(name, error.bound, index=index, value=error.value) from None


def _count(arrays: Mapping[str, Vector], count: int | None) -> int:
    most = core().most_batch_elements
    if count is not None and not is_whole(count, 0, most):
        raise InvalidArgument("count", f"must be a whole number in [0, {most}]", value=count)
    if count is None and not arrays:
        raise InvalidArgument("count", "must be given where no array is")
    n = int(len(next(iter(arrays.values()))) if count is None else count)
    for name, values in arrays.items():
        if len(values) != n:
            raise InvalidProblem(name, f"must have {n} elements, as many as the batch", value=f"{len(values)} elements")
    return n
