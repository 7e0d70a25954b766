"""The functions of a nonlinear problem as the native loop calls them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.lazy import lazy
from marble.errors import InvalidArgument, InvalidProblem

sp: Any = lazy("scipy.sparse")

_PARTS: Final = ("equalities", "inequalities", "G", "H", "residuals")


@dataclass(frozen=True)
class Multipliers:
    """With ∇f + ∇c_Eᵀy − ∇c_Iᵀnu − ∇Gᵀxi − ∇Hᵀeta = bounds at a solution."""

    y: NDArray[np.float64]
    nu: NDArray[np.float64]
    xi: NDArray[np.float64]
    eta: NDArray[np.float64]


def _check_real(values: Any) -> None:
    if np.iscomplexobj(values):
        raise InvalidProblem("numbers", "must be real", value="of a complex type")


def vector(values: Any) -> NDArray[np.float64]:
    """As doubles, contiguous and flat."""
    _check_real(values)
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)


def broadcast(bound: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """A number or an entry each, of this shape."""
    _check_real(bound)
    return np.broadcast_to(np.asarray(bound, dtype=np.float64), shape)


class TwoSided:
    """Rows low ≤ g ≤ high by their numbers: those with equal bounds, and of the others those with either."""

    def __init__(self, low: ArrayLike, high: ArrayLike, count: int) -> None:
        self.low, self.high = (broadcast(bound, (count,)) for bound in (low, high))
        self.equal = np.flatnonzero(self.low == self.high)
        self.above = np.flatnonzero((self.low != self.high) & (self.low > -np.inf))
        self.below = np.flatnonzero((self.low != self.high) & (self.high < np.inf))


def _matrix(given: Any) -> Any:
    """In compressed columns; of a dense one every entry is stored, so that its pattern stays."""
    _check_real(given)
    if sp.issparse(given):
        made = sp.csc_matrix(given, dtype=np.float64)
        made.sort_indices()
        return made
    dense = np.atleast_2d(np.asarray(given, dtype=np.float64))
    rows, columns = dense.shape
    indices = np.tile(np.arange(rows, dtype=np.int32), columns)
    pointers = np.arange(0, rows * columns + 1, rows, dtype=np.int32) if rows else np.zeros(columns + 1, np.int32)
    return sp.csc_matrix((dense.ravel(order="F"), indices, pointers), shape=dense.shape)


def _known(given: Mapping[str, Any], first: str, what: str) -> None:
    others = sorted(set(given) - {first, *_PARTS})
    if first not in given or others:
        raise InvalidArgument(what, f"must have {first!r}, and may have {', '.join(_PARTS)}; it has {sorted(given)}")


def problem_of(
    values: Callable[[NDArray[np.float64]], Mapping[str, Any]],
    derivatives: Callable[[NDArray[np.float64]], Mapping[str, Any]],
    hessian: Callable[[NDArray[np.float64], Multipliers], Any] | None,
    x0: ArrayLike,
    lower: ArrayLike | None,
    upper: ArrayLike | None,
    scale: ArrayLike | None,
    blocks: Sequence[int] | None,
) -> dict[str, Any]:
    """What marble._core takes for a problem; what the functions give is checked when they are called."""

    def of_values(x: Any) -> tuple[Any, ...]:
        given = values(np.asarray(x))
        _known(given, "objective", "values")
        return float(given["objective"]), *(vector(given.get(name, ())) for name in _PARTS)

    def of_derivatives(x: Any) -> tuple[Any, ...]:
        given = derivatives(np.asarray(x))
        _known(given, "gradient", "derivatives")
        return vector(given["gradient"]), *(_matrix(given[name]) if name in given else None for name in _PARTS)

    def of_hessian(x: Any, *multipliers: Any) -> Any:
        assert hessian is not None
        given = Multipliers(*(np.asarray(part, dtype=np.float64) for part in multipliers))
        full = _matrix(hessian(np.asarray(x), given))
        return _matrix(sp.triu(full, format="csc"))

    return {"values": of_values, "derivatives": of_derivatives, "hessian": None if hessian is None else of_hessian,
            "start": vector(x0), "lower": vector(() if lower is None else lower),
            "upper": vector(() if upper is None else upper), "scale": vector(() if scale is None else scale),
            "blocks": np.asarray(() if blocks is None else blocks, dtype=np.int32)}
