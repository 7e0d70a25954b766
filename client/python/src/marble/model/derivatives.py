"""Derivatives of a solution with respect to its problem's numbers: requests with a solve, and results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.tables import MATRICES, SOLUTION_VECTORS, VECTORS
from marble.errors import Error, InvalidArgument
from marble.model import lcqp
from marble.model.lcqp import LCQP, MatrixLike, Vector

LETTERS: Final = (*VECTORS, *MATRICES)
ANSWER: Final = tuple(SOLUTION_VECTORS)


@dataclass(frozen=True, eq=False)
class AnswerChange:
    """Changes of an answer's z and multipliers by one unit of a direction, with the names and sizes of Solution.

    active_set_constant: whether the answer goes this way for small positive steps; always true where the sensitivity is
    smooth.
    """

    z: Vector
    y: Vector
    nu: Vector
    xi: Vector
    eta: Vector
    active_set_constant: bool


@dataclass(frozen=True, eq=False)
class RowResponse:
    """How m combinations E z follow a price μ: with the cost μᵀE z added the branch has E z = free − response μ.

    values: E z at the answer, m. free: at μ = 0, without the proximal term and with the cost that was asked for; the
    same where neither was given. response: m × m, symmetric, positive semidefinite. z, n, and columns, n × m: the
    branch has z − columns μ; empty unless columns were asked for.
    """

    values: Vector
    free: Vector
    response: NDArray[np.float64]
    z: Vector
    columns: NDArray[np.float64]


RESPONSE: Final = tuple(part.name for part in fields(RowResponse))

@dataclass(frozen=True, eq=False)
class SensitivityRequest:
    """What is asked of an answer's derivatives with a solve. All are of its branch: rows at zero stay there.

    rows: E, m × n, dense or any scipy.sparse: their response to a price. proximal: n numbers ≥ 0, a diagonal that was
    added to Q, without which the response is wanted; costs one more factorization. g: n, the linear cost in place of
    the problem's own, for free and z of the response. columns: z and columns of it are wanted too.
    directions: each new numbers less the old ones by the letters of the equation, as Sensitivity.jvp takes them.
    losses: each a loss's derivatives by z, y, nu, xi and eta, as Sensitivity.vjp takes them.
    """

    rows: MatrixLike | None = None
    proximal: ArrayLike | None = None
    g: ArrayLike | None = None
    columns: bool = False
    directions: Sequence[Mapping[str, ArrayLike]] = ()
    losses: Sequence[Mapping[str, ArrayLike]] = ()


@dataclass(frozen=True, eq=False)
class SensitivityAnswer:
    """The derivatives that were asked for with a solve; attributes of what was not asked for are empty.

    error: why there are none: the answer is not solved, or no isolated exact solution of a branch; else None.
    weak_inequalities, biactive_pairs, smooth: as in Sensitivity. rows: the response of rows; rows_error: why there is
    none: the branch is flat along one, or not convex without the proximal term.
    changes: z, y, nu, xi and eta, k × their sizes, of k directions; active_set_constant: k. gradients: by the letters
    of the equation, k × the numbers of each part, of k losses. undefined_changes, undefined_gradients: those that have
    none, whose numbers
    are NaN: the branch is flat along them, or its rows depend on each other. factorizations: 0 where the solve's last
    factor was the branch's; they count in Solution.factorizations too. back_substitutions: with one factor.
    """

    error: Error | None = None
    weak_inequalities: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    biactive_pairs: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    rows: RowResponse | None = None
    rows_error: Error | None = None
    changes: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    active_set_constant: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    undefined_changes: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    gradients: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    undefined_gradients: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    factorizations: int = 0
    back_substitutions: int = 0

    @property
    def smooth(self) -> bool:
        """Whether there are neither weak inequalities nor biactive pairs."""
        return not (self.weak_inequalities.size or self.biactive_pairs.size)

    def raise_if_undefined(self) -> SensitivityAnswer:
        """Itself; raises the error if there are no derivatives."""
        if self.error is not None:
            raise self.error
        return self


@dataclass(frozen=True, eq=False)
class Asked:
    """A request as the solver takes it: of a problem, checked; parts of k directions or losses one after the other."""

    rows: Any
    proximal: Vector
    g: Vector
    columns: bool
    directions: int
    numbers: dict[str, Vector]
    losses: int
    weights: dict[str, Vector]


def of_letters(values: Mapping[str, Any], known: Sequence[str], name: str) -> Mapping[str, Any]:
    """`values`, whose keys must be known."""
    others = sorted(set(values) - set(known))
    if others:
        raise InvalidArgument(name, f"must be of {', '.join(known)}", value=others[0])
    return values


def numbers_of(values: Any) -> Any:
    """What stands for a part: of a sparse matrix its stored entries."""
    return values.data if hasattr(values, "nnz") else values


def _packed(given: Sequence[Mapping[str, Any]], sizes: Mapping[str, int], name: str) -> dict[str, Vector]:
    packed: dict[str, Vector] = {}
    for k, one in enumerate(given):
        for letter, values in of_letters(one, tuple(sizes), name).items():
            size = sizes[letter]
            part = packed.setdefault(letter, np.zeros(len(given) * size))
            part[k * size:(k + 1) * size] = lcqp.vector(numbers_of(values), f"{name}.{letter}", size)
    return packed


def _or_nothing(values: ArrayLike | None, name: str, size: int) -> Vector:
    return np.zeros(0) if values is None else lcqp.vector(values, name, size, " (n)")


def asked(request: SensitivityRequest, problem: LCQP) -> Asked:
    """The request of this problem. Raises InvalidArgument with fields like "sensitivity.directions.b"."""
    n, n_e, n_i, n_c = problem.sizes
    numbers = {letter: getattr(problem, letter).size for letter in VECTORS}
    numbers.update({letter: getattr(problem, letter).nnz for letter in MATRICES})
    rows = None if request.rows is None else lcqp.matrix(request.rows, "sensitivity.rows", n)
    return Asked(rows, _or_nothing(request.proximal, "sensitivity.proximal", n),
                 _or_nothing(request.g, "sensitivity.g", n), bool(request.columns),
                 len(request.directions), _packed(request.directions, numbers, "sensitivity.directions"),
                 len(request.losses),
                 _packed(request.losses, dict(zip(ANSWER, (n, n_e, n_i, n_c, n_c), strict=True)), "sensitivity.losses"))


def response(values: Vector, free: Vector, packed: Vector, z: Vector, columns: Vector) -> RowResponse:
    """A RowResponse of the solver's numbers: the upper triangle by columns, and columns one after the other."""
    m = values.size
    full = np.zeros((m, m))
    j, i = np.tril_indices(m)
    full[i, j] = full[j, i] = packed
    return RowResponse(values, free, full, z, columns.reshape(m, -1).T if columns.size else np.zeros((0, 0)))


def by_part(parts: Mapping[str, Vector], count: int) -> dict[str, NDArray[np.float64]]:
    """Each part of `count` directions or losses, one row each."""
    return {name: values.reshape(count, -1) for name, values in parts.items()} if count else {}
