"""Which outputs of a JAX function may depend on which entries of its argument, whatever the numbers are.

The function's jaxpr is followed by sets of entries instead of numbers. What moves numbers (slices, reshapes, gathers,
scatters) is done on their places; sums and products with known matrices join the sets that meet; of a choice by numbers
that are not known all sides count. A primitive that is not known here joins all it is given: the pattern is then larger
than it must be, and never smaller.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from marble.base.lazy import lazy

sp: Any = lazy("scipy.sparse")

_LARGEST_PRODUCT: Final = 10**7  # pairs of entries that meet in a product of matrices; of a larger one all join all

# Each number of the outcome from the numbers at its place.
_ELEMENTWISE: Final = frozenset((
    "abs acos acosh add add_any and asin asinh atan atan2 atanh cbrt clamp complex conj convert_element_type copy "
    "copy_p cos cosh digamma div erf erf_inv erfc exp exp2 expm1 imag integer_pow lgamma log log1p logistic max min "
    "mul neg nextafter not or polygamma pow real reduce_precision rem rsqrt select_n sin sinh sqrt square sub tan tanh "
    "xor mul_add optimization_barrier").split())
# No derivative anywhere.
_FLAT: Final = frozenset(
    "argmax argmin ceil eq eq_to floor ge gt iota is_finite le le_to lt lt_to ne round sign stop_gradient".split())
# What stands at each place of the outcome stood somewhere in the operands before the others, which must be known.
_MOVES: Final = {"broadcast_in_dim": 1, "concatenate": None, "dynamic_slice": 1, "dynamic_update_slice": 2,
                 "expand_dims": 1, "gather": 1, "pad": 2, "reshape": 1, "rev": 1, "slice": 1, "split": 1, "squeeze": 1,
                 "stack": None, "transpose": 1, "unstack": 1}
_REDUCES: Final = frozenset("reduce_and reduce_max reduce_min reduce_or reduce_prod reduce_sum".split())
_RUNNING: Final = frozenset("cumlogsumexp cummax cummin cumprod cumsum".split())
_SCATTERS: Final = frozenset("scatter scatter-add scatter_add scatter-max scatter-min scatter-mul scatter-sub".split())


def _broadcast(values: Sequence[Any], shape: tuple[int, ...], params: Any) -> Any:
    aligned = np.ones(len(shape), dtype=np.intp)
    aligned[list(params["broadcast_dimensions"])] = values[0].shape
    return np.broadcast_to(values[0].reshape(aligned), shape)


def _slice(values: Sequence[Any], shape: tuple[int, ...], params: Any) -> Any:
    strides = params["strides"] or [1] * len(shape)
    return values[0][tuple(map(slice, params["start_indices"], params["limit_indices"], strides))]


_BY_NUMPY: Final[dict[str, Callable[[Sequence[Any], tuple[int, ...], Any], Any]]] = {
    "broadcast_in_dim": _broadcast, "slice": _slice,
    "concatenate": lambda values, shape, params: np.concatenate(values, params["dimension"]),
    "rev": lambda values, shape, params: np.flip(values[0], params["dimensions"]),
    "transpose": lambda values, shape, params: np.transpose(values[0], params["permutation"]),
    **dict.fromkeys(("expand_dims", "reshape", "squeeze"), lambda values, shape, params: values[0].reshape(shape))}


@dataclass
class _Traced:
    """An array within the function: its shape, a row of entries of the argument each of its places may depend on, and
    its numbers where they depend on nothing that is not known."""

    shape: tuple[int, ...]
    rows: Any
    known: Any = None


def pattern_of(function: Callable[..., Any], size: int, *others: Any) -> Any:
    """A boolean csr_matrix: a row for each output of function(x, *others), a column for each of the `size` entries.

    Of the others the numbers may be any of those shapes.
    """
    jax: Any = importlib.import_module("jax")
    closed = jax.make_jaxpr(function)(np.zeros(size), *others)
    first = _Traced((size,), sp.identity(size, dtype=bool, format="csr"))
    rest = [_independent(np.shape(leaf), size) for leaf in jax.tree_util.tree_leaves(others)]
    outputs = _Tracer(jax, size).run(closed.jaxpr, closed.consts, [first, *rest])
    return sp.vstack([sp.csr_matrix((0, size), dtype=bool), *(output.rows for output in outputs)], format="csr")


def _independent(shape: tuple[int, ...], size: int, known: Any = None) -> _Traced:
    return _Traced(tuple(shape), sp.csr_matrix((math.prod(shape), size), dtype=bool), known)


class _Tracer:
    def __init__(self, jax: Any, size: int) -> None:
        self._jax, self._size = jax, size

    def run(self, jaxpr: Any, consts: Sequence[Any], inputs: Sequence[_Traced]) -> list[_Traced]:
        """The outputs of a jaxpr."""
        kept: dict[Any, _Traced] = {}

        def read(atom: Any) -> _Traced:
            return self._constant(atom.val) if hasattr(atom, "val") else kept[atom]

        kept.update(zip(jaxpr.constvars, map(self._constant, consts), strict=True))
        kept.update(zip(jaxpr.invars, inputs, strict=True))
        for equation in jaxpr.eqns:
            kept.update(zip(equation.outvars, self._outcome(equation, [read(atom) for atom in equation.invars]),
                            strict=True))
        return [read(atom) for atom in jaxpr.outvars]

    def _constant(self, value: Any) -> _Traced:
        return _independent(np.shape(value), self._size, value)

    def _outcome(self, equation: Any, given: list[_Traced]) -> list[_Traced]:
        shapes = [tuple(getattr(variable.aval, "shape", ())) for variable in equation.outvars]
        name, params = equation.primitive.name, equation.params
        inner = next((params[key] for key in ("jaxpr", "call_jaxpr", "fun_jaxpr") if key in params), None)
        if inner is not None and name not in ("scan", "while"):
            closed = hasattr(inner, "consts")
            jaxpr = inner.jaxpr if closed else inner
            if len(jaxpr.invars) == len(given):
                return self.run(jaxpr, inner.consts if closed else (), given)
        if all(each.known is not None for each in given):
            values = self._bind(equation, [each.known for each in given])
            return [_independent(np.shape(value), self._size, value) for value in values]
        if name in _FLAT:
            return [_independent(shape, self._size) for shape in shapes]
        if name == "scan":
            return self._scan(params, given)
        if name == "cond":
            return self._choice(params, given)
        rows = self._rows(name, equation, given, shapes)
        if rows is None:  # everything with everything
            union = self._union([each.rows for each in given])
            rows = [union[np.zeros(math.prod(shape), dtype=np.intp)] for shape in shapes]
        return [_Traced(shape, each) for shape, each in zip(shapes, rows, strict=True)]

    def _bind(self, equation: Any, values: list[Any]) -> list[Any]:
        by_numpy = _BY_NUMPY.get(equation.primitive.name)  # which compiles nothing
        if by_numpy is not None:
            shape = equation.outvars[0].aval.shape
            return [by_numpy([np.asarray(value) for value in values], shape, equation.params)]
        outcome = equation.primitive.bind(*values, **equation.params)
        return list(outcome) if equation.primitive.multiple_results else [outcome]

    def _rows(self, name: str, equation: Any, given: list[_Traced], shapes: list[tuple[int, ...]]) -> list[Any] | None:
        if name in _ELEMENTWISE:
            if name == "select_n" and given[0].known is not None:
                return self._moved(equation, given, range(1, len(given)))
            return [self._elementwise(name, given, shapes[0])]
        if name in _MOVES:
            count = _MOVES[name] or len(given)
            return self._moved(equation, given, range(count))
        if name in _REDUCES:
            shape, axes = given[0].shape, equation.params["axes"]
            kept = [1 if axis in axes else length for axis, length in enumerate(shape)]
            return [self._summed(np.broadcast_to(np.arange(math.prod(kept)).reshape(kept), shape).ravel(),
                                 np.arange(math.prod(shape)), math.prod(kept), given[0])]
        if name in _RUNNING:
            return [self._running(given[0], equation.params["axis"], equation.params["reverse"])]
        if name in _SCATTERS and given[1].known is not None:
            return [self._scattered(equation.params, *given)]
        if name == "dot_general":
            contracted, batched = equation.params["dimension_numbers"]
            return self._product(contracted, batched, given)
        return None

    def _elementwise(self, name: str, given: list[_Traced], shape: tuple[int, ...]) -> Any:
        total = sp.csr_matrix((math.prod(shape), self._size), dtype=bool)
        for each, other in zip(given, given[::-1], strict=True):
            places = np.broadcast_to(np.arange(math.prod(each.shape)).reshape(each.shape), shape).ravel()
            rows = each.rows if places.size == each.rows.shape[0] else each.rows[places]
            if name == "mul" and other.known is not None:  # nothing comes through a zero
                through = np.broadcast_to(np.asarray(other.known) != 0, shape).ravel()
                rows = sp.diags(through.astype(bool), format="csr", dtype=bool) @ rows
            total = total + rows
        return total

    def _union(self, rows: Sequence[Any]) -> Any:
        columns = np.unique(np.concatenate([np.zeros(0, dtype=np.intp), *(each.indices for each in rows)]))
        return sp.csr_matrix((np.ones(columns.size, dtype=bool), (np.zeros_like(columns), columns)), (1, self._size))

    def _moved(self, equation: Any, given: list[_Traced], moving: range) -> list[Any] | None:
        """The primitive itself moves the places of what it would move."""
        if any(each.known is None for i, each in enumerate(given) if i not in moving):
            return None
        values, first = [each.known for each in given], 1
        for i in moving:
            count = math.prod(given[i].shape)
            values[i] = np.arange(first, first + count, dtype=np.float64).reshape(given[i].shape)
            first += count
        rows = sp.vstack([sp.csr_matrix((1, self._size), dtype=bool), *(given[i].rows for i in moving)], format="csr")
        places = (np.nan_to_num(np.asarray(value).ravel()).astype(np.intp) for value in self._bind(equation, values))
        return [rows[place] for place in places]  # place 0: from nowhere

    def _summed(self, to: NDArray[np.intp], source: NDArray[np.intp], count: int, given: _Traced) -> Any:
        meets = sp.csr_matrix((np.ones(to.size, dtype=bool), (to, source)), (count, given.rows.shape[0]))
        return meets @ given.rows

    def _running(self, given: _Traced, axis: int, reverse: bool) -> Any:
        places = np.moveaxis(np.arange(math.prod(given.shape)).reshape(given.shape), axis, 0)
        places = places[::-1] if reverse else places
        later, earlier = np.tril_indices(len(places))
        return self._summed(places[later].ravel(), places[earlier].ravel(), math.prod(given.shape), given)

    def _scattered(self, params: Any, target: _Traced, indices: _Traced, updates: _Traced) -> Any:
        jax, count = self._jax, math.prod(target.shape)

        def added(parts: Any) -> Any:
            return jax.lax.scatter_add(np.zeros(target.shape), indices.known, parts, params["dimension_numbers"],
                                       mode=params["mode"])

        # Where each update goes: what the transpose of that sum finds there of the numbered places of the target.
        _, pull = jax.vjp(added, np.zeros(updates.shape))
        places = np.asarray(pull(jax.numpy.arange(1.0, count + 1).reshape(target.shape))[0]).ravel().astype(np.intp)
        inside = np.flatnonzero(places)
        return target.rows + self._summed(places[inside] - 1, inside, count, updates)

    def _product(self, contracted: Any, batched: Any, given: list[_Traced]) -> list[Any] | None:
        """Of every pair of entries that meet; a known zero lets nothing through."""
        places = []
        for side, each in enumerate(given):
            batch, inner = list(batched[side]), list(contracted[side])
            free = [axis for axis in range(len(each.shape)) if axis not in batch and axis not in inner]
            arranged = np.arange(math.prod(each.shape)).reshape(each.shape).transpose(batch + free + inner)
            lengths = [math.prod(each.shape[axis] for axis in axes) for axes in (batch, free, inner)]
            places.append(arranged.reshape(lengths))
        left, right = places[0][:, :, None, :], places[1][:, None, :, :]
        shape = np.broadcast_shapes(left.shape, right.shape)
        if math.prod(shape) > _LARGEST_PRODUCT:
            return None
        count = math.prod(shape[:3])
        to = np.broadcast_to(np.arange(count).reshape(*shape[:3], 1), shape).ravel()
        left, right = np.broadcast_to(left, shape).ravel(), np.broadcast_to(right, shape).ravel()
        total = sp.csr_matrix((count, self._size), dtype=bool)
        for places_of, each, others, other in ((left, given[0], right, given[1]), (right, given[1], left, given[0])):
            through = slice(None) if other.known is None else np.asarray(other.known).ravel()[others] != 0
            total = total + self._summed(to[through], places_of[through], count, each)
        return [total]

    def _scan(self, params: Any, given: list[_Traced]) -> list[_Traced]:
        constants, carried = params["num_consts"], params["num_carry"]
        fixed, carry, series = given[:constants], given[constants:constants + carried], given[constants + carried:]
        inner, length = params["jaxpr"], params["length"]
        collected: list[list[_Traced]] = []
        for step in range(length)[::-1] if params["reverse"] else range(length):
            outputs = self.run(inner.jaxpr, inner.consts, [*fixed, *carry, *(_part(each, step) for each in series)])
            carry = outputs[:carried]
            collected.append(outputs[carried:])
        if params["reverse"]:
            collected.reverse()
        stacked = []
        for parts in zip(*collected, strict=True):
            known = None if any(p.known is None for p in parts) else np.stack([np.asarray(p.known) for p in parts])
            stacked.append(_Traced((length, *parts[0].shape), sp.vstack([p.rows for p in parts], format="csr"), known))
        if not collected:
            return [*carry, *(_independent(v.aval.shape, self._size) for v in inner.jaxpr.outvars[carried:])]
        return [*carry, *stacked]

    def _choice(self, params: Any, given: list[_Traced]) -> list[_Traced]:
        which, *operands = given
        branches = params["branches"]
        if which.known is not None:
            chosen = branches[min(max(int(which.known), 0), len(branches) - 1)]
            return self.run(chosen.jaxpr, chosen.consts, operands)
        all_outputs = [self.run(branch.jaxpr, branch.consts, operands) for branch in branches]
        return [_Traced(parts[0].shape, sum((part.rows for part in parts[1:]), parts[0].rows))
                for parts in zip(*all_outputs, strict=True)]


def _part(series: _Traced, step: int) -> _Traced:
    shape = series.shape[1:]
    size = math.prod(shape)
    return _Traced(shape, series.rows[step * size:(step + 1) * size],
                   None if series.known is None else np.asarray(series.known)[step])
