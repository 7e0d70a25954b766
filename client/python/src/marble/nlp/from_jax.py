"""Functions written for JAX: derivatives by JAX, compiled once, in double precision, with the patterns found first."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.lazy import lazy
from marble.errors import InvalidArgument
from marble.nlp import jax_pattern
from marble.nlp.functions import Multipliers, TwoSided, vector

sp: Any = lazy("scipy.sparse")

_NAMES: Final = ("f", "g", "G", "H")


class JaxFunctions:
    """What `solve`, `RealTime` and their like take, of functions written for JAX: values, derivatives, hessian.

    functions: of x, by the names f (a number) and, where there are any, g, G and H (arrays, of which all entries
    count); with p, of x and p. p: parameters, any tree of arrays; may be set anew between two solves, to ones of the
    same shapes, and nothing is compiled again. size: of x. lbg, ubg: bounds of g; rows with equal bounds are
    equalities; of the others those with a lower bound are the first inequalities, those with an upper one the rest.

    JAX computes in double precision here, whatever is set elsewhere; an array that a function brings along should be
    numpy's, since JAX's own is single by default. Jacobians and the Hessian of the Lagrangian are sparse: their
    patterns are those of what the functions compute, whatever the numbers are, and columns that meet in no row are
    computed at once. A row of all variables makes as many of them as there are variables. Loops of unknown length
    (`while_loop`), sorting and factorizations count as if all they give depended on all they take. Errors:
    InvalidArgument of field "problem", and what JAX raises where it cannot trace a function.
    """

    def __init__(self, functions: Mapping[str, Callable[..., Any]], size: int, *, p: Any = None,
                 lbg: ArrayLike = -np.inf, ubg: ArrayLike = np.inf) -> None:
        others = sorted(set(functions) - set(_NAMES))
        if others or "f" not in functions:
            raise InvalidArgument("problem", f"must have f, and may have g, G and H; it has {sorted(functions)}")
        jax: Any = importlib.import_module("jax")
        jnp = jax.numpy
        self._jax, self.p = jax, p

        def part(name: str, x: Any, parameters: Any) -> Any:
            if name not in functions:
                return jnp.zeros(0)
            given = functions[name](x) if p is None else functions[name](x, parameters)
            return jnp.ravel(jnp.asarray(given, dtype=np.float64))

        def objective(x: Any, parameters: Any) -> Any:
            return part("f", x, parameters)[0]

        with self._doubles():
            counts = {name: jax.eval_shape(lambda x, name=name: part(name, x, p), np.zeros(size)).size
                      for name in functions}
            if counts["f"] != 1:
                raise InvalidArgument("problem", f"f must be a number; it has {counts['f']} entries")
            sides = TwoSided(lbg, ubg, counts.get("g", 0))

            def rows(x: Any, parameters: Any) -> Any:
                g = part("g", x, parameters)
                return (g[sides.equal] - sides.low[sides.equal],
                        jnp.concatenate([g[sides.above] - sides.low[sides.above],
                                         sides.high[sides.below] - g[sides.below]]),
                        part("G", x, parameters), part("H", x, parameters))

            def stacked(x: Any, parameters: Any) -> Any:
                return jnp.concatenate(rows(x, parameters))

            def lagrangian_slope(x: Any, parameters: Any, weights: Any) -> Any:
                return jax.grad(lambda at: objective(at, parameters) + stacked(at, parameters) @ weights)(x)

            count = jax.eval_shape(lambda x: stacked(x, p), np.zeros(size)).size
            pairs = counts.get("G", 0), counts.get("H", 0)
            self._ends = np.cumsum([sides.equal.size, sides.above.size + sides.below.size, *pairs])
            self._jacobian = _Compressed(jax_pattern.pattern_of(stacked, size, p))
            of_slopes = jax_pattern.pattern_of(lagrangian_slope, size, p, np.zeros(count))
            self._hessian = _Compressed(of_slopes + of_slopes.T)

            def forward(function: Callable[[Any], Any], x: Any, seeds: Any) -> Any:
                return jax.vmap(lambda seed: jax.jvp(function, (x,), (seed,))[1])(seeds)

            def slopes(x: Any, parameters: Any) -> Any:
                return (jax.grad(objective)(x, parameters),
                        forward(lambda at: stacked(at, parameters), x, self._jacobian.seeds))

            def curvature(x: Any, parameters: Any, weights: Any) -> Any:
                return forward(lambda at: lagrangian_slope(at, parameters, weights), x, self._hessian.seeds)

            self._of_values = jax.jit(lambda x, parameters: (objective(x, parameters), *rows(x, parameters)))
            self._of_slopes, self._of_curvature = jax.jit(slopes), jax.jit(curvature)

    @contextlib.contextmanager
    def _doubles(self) -> Iterator[None]:
        of_old = not hasattr(self._jax, "enable_x64")
        with (importlib.import_module("jax.experimental") if of_old else self._jax).enable_x64(True):
            yield

    def values(self, x: NDArray[np.float64]) -> dict[str, Any]:
        """As `solve` takes them."""
        with self._doubles():
            objective, *rows = self._of_values(x, self.p)
        return {"objective": float(objective),
                **dict(zip(("equalities", "inequalities", "G", "H"), map(vector, rows), strict=True))}

    def derivatives(self, x: NDArray[np.float64]) -> dict[str, Any]:
        """As `solve` takes them; csr_matrix."""
        with self._doubles():
            gradient, compressed = self._of_slopes(x, self.p)
        jacobian = self._jacobian.matrix(np.asarray(compressed))
        parts = zip((0, *self._ends[:-1]), self._ends, strict=True)
        return {"gradient": vector(gradient),
                **{name: jacobian[first:end] for name, (first, end)
                   in zip(("equalities", "inequalities", "G", "H"), parts, strict=True)}}

    def hessian(self, x: NDArray[np.float64], multipliers: Multipliers) -> Any:
        """As `solve` takes it; csr_matrix."""
        m = multipliers
        with self._doubles():
            compressed = self._of_curvature(x, self.p, np.concatenate([m.y, -m.nu, -m.xi, -m.eta]))
        return self._hessian.matrix(np.asarray(compressed))


class _Compressed:
    """A sparse matrix from its products with few vectors: columns of one colour meet in no row."""

    def __init__(self, pattern: Any) -> None:
        self._pattern = sp.csr_matrix(pattern, dtype=np.float64)
        self._pattern.sum_duplicates()
        rows, columns = self._pattern.shape
        of_columns = self._pattern.tocsc()
        colours = np.zeros(columns, dtype=np.intp)
        taken: list[set[int]] = [set() for _ in range(rows)]
        for j in np.argsort(-np.diff(of_columns.indptr), kind="stable"):
            met = of_columns.indices[of_columns.indptr[j]:of_columns.indptr[j + 1]]
            forbidden = set().union(*(taken[i] for i in met))
            colours[j] = next(c for c in range(columns) if c not in forbidden)
            for i in met:
                taken[i].add(int(colours[j]))
        self.seeds = np.zeros((int(colours.max(initial=-1)) + 1, columns))
        self.seeds[colours, np.arange(columns)] = 1.0
        self._rows = np.repeat(np.arange(rows), np.diff(self._pattern.indptr))
        self._colours = colours[self._pattern.indices]

    def matrix(self, products: NDArray[np.float64]) -> Any:
        """products: a row for each of the seeds."""
        made = self._pattern.copy()
        made.data[:] = products[self._colours, self._rows]
        return made
