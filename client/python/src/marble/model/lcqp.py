"""The problem as the solver takes it: checked, sparse, and owned."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.html import table
from marble.base.lazy import lazy
from marble.base.tables import LONGEST_PROBLEM_NAME, SYMMETRY
from marble.errors import InvalidProblem

sp: Any = lazy("scipy.sparse")

Vector = NDArray[np.float64]
MatrixLike = Any
"""A dense array (a vector is one row), nested lists, or any scipy.sparse matrix or array."""

_MOST_ENTRIES: Final = 2**31 - 1
_FEW_ENTRIES: Final = 1000


def numbers(values: Any, field: str, what: str = "numbers") -> Vector:
    """A copy of real numbers as doubles. Texts, dates, records, complex and masked entries are no numbers."""
    try:
        given = np.asanyarray(values)
        if given.dtype.kind not in "biufO":
            raise InvalidProblem(field, f"must be {what}", value=f"of type {given.dtype}")
        if isinstance(given, np.ma.MaskedArray) and np.any(given.mask):
            raise InvalidProblem(field, "must not have masked entries")
        return np.array(given, dtype=np.float64)
    except MemoryError:
        raise InvalidProblem(field, "must fit into memory", value=f"of shape {np.shape(values)}") from None
    except (OverflowError, TypeError, ValueError) as error:
        if isinstance(error, InvalidProblem):
            raise
        raise InvalidProblem(field, f"must be {what} ({error})") from None


def vector(values: ArrayLike, field: str, size: int | None = None, rule: str = "") -> Vector:
    """A copy of `values` as a vector of finite doubles; `size` entries if that is given, because of `rule`."""
    array = numbers(values, field)
    if array.ndim == 0:
        array = array.reshape(1)
    elif array.ndim == 2 and 1 in array.shape:
        array = array.reshape(-1)
    if array.ndim != 1:
        raise InvalidProblem(field, "must be a vector", value=f"of shape {array.shape}")
    if size is not None and array.size != size:
        raise InvalidProblem(field, f"must have {size} entries{rule}", value=f"{array.size} entries")
    finite = np.isfinite(array)
    if not finite.all():
        bad = int(np.argmin(finite))
        raise InvalidProblem(field, "must be finite", index=bad, value=array[bad])
    return array


@functools.lru_cache(maxsize=64)
def _empty(rows: int, columns: int) -> Any:
    made = sp.csc_matrix((rows, columns))
    made.has_canonical_format = True
    return made


def csc(data: Vector, indices: Any, indptr: Any, shape: tuple[int, int]) -> Any:
    """A csc_matrix of these arrays, known to be right and sorted: scipy's own checks take 20 times as long."""
    made = twin(_empty(*shape))
    made.data, made.indices, made.indptr = data, indices, indptr
    return made


def twin(thing: Any) -> Any:
    """A shallow copy; copy.copy takes five times as long."""
    made = object.__new__(type(thing))
    made.__dict__.update(thing.__dict__)
    return made


def as_rows(values: Any) -> Any:
    """A sparse vector as one row; all else as it is."""
    return values.tocoo().reshape(1, -1) if sp.issparse(values) and values.ndim == 1 else values


def _dense(values: MatrixLike, field: str) -> Any:
    dense = numbers(values, field, "a matrix of numbers")
    if dense.ndim > 2:
        raise InvalidProblem(field, "must be a matrix", value=f"of shape {dense.shape}")
    return np.atleast_2d(dense)


def _entries(dense: Any, upper: bool = False) -> Any:
    """A csc_matrix of what is not zero, or of that in the upper triangle."""
    column, row = np.nonzero(dense.T)
    if upper:
        kept = row <= column
        column, row = column[kept], row[kept]
    indptr = column.searchsorted(np.arange(dense.shape[1] + 1)).astype(np.int32)
    return csc(dense[row, column], row.astype(np.int32), indptr, dense.shape)


def _check_pattern(values: Any, field: str) -> None:
    """InvalidProblem where a sparse matrix's arrays do not fit each other: scipy's compiled code would not notice."""
    if values.dtype.kind not in "biuf":
        raise InvalidProblem(field, "must be a matrix of numbers", value=f"of type {values.dtype}")
    if values.format != "coo":
        block = values.blocksize if values.format == "bsr" else (1, 1)
        outer, inner = (values.shape[0] // block[0], values.shape[1] // block[1])
        if values.format == "csc":
            outer, inner = inner, outer
        pointers, indices, count = values.indptr, values.indices, len(values.data)
        good = (len(pointers) == outer + 1 and pointers[0] == 0 and pointers[-1] <= len(indices) == count
                and bool((pointers[1:] >= pointers[:-1]).all()) and _are_within(indices, inner))
    else:
        good = (len(values.row) == len(values.col) == len(values.data) and _are_within(values.row, values.shape[0])
                and _are_within(values.col, values.shape[1]))
    if not good:
        raise InvalidProblem(field, f"must have the arrays of a {values.format} matrix of shape {values.shape}: "
                             "ascending pointers from 0, indices within the shape")


def _are_within(indices: Any, size: int) -> bool:
    return len(indices) == 0 or bool(indices.min() >= 0 and indices.max() < size)


def matrix(values: MatrixLike, field: str, columns: int, rows: int | None = None) -> Any:
    """A csc_matrix of finite doubles with sorted, unique entries; explicit zeros stay part of the pattern."""
    values = as_rows(values)
    if sp.issparse(values):
        if values.format not in ("csc", "csr", "bsr", "coo"):
            values = values.tocoo()
        _check_pattern(values, field)
    if isinstance(values, sp.csc_matrix) and values.dtype == np.float64 and values.has_canonical_format:
        count = int(values.indptr[-1])  # there may be room behind them
        result = csc(values.data[:count].copy(), values.indices[:count].copy(), values.indptr.copy(), values.shape)
    elif sp.issparse(values):
        result = sp.csc_matrix(values, dtype=np.float64, copy=True)
        result.sum_duplicates()
    else:
        result = _entries(_dense(values, field))
    if result.shape[1] != columns:
        raise InvalidProblem(field, f"must have {columns} columns, one a variable",
                             value=f"of shape {result.shape}")
    if rows is not None and result.shape[0] != rows:
        raise InvalidProblem(field, f"must have {rows} rows", value=f"of shape {result.shape}")
    if result.data.size > _MOST_ENTRIES:
        raise InvalidProblem(field, "must have less than 2**31 entries", value=f"{result.nnz} entries")
    finite = np.isfinite(result.data)
    if not finite.all():
        bad = int(np.argmin(finite))
        raise InvalidProblem(field, "must be finite", index=position(result, bad), value=result.data[bad])
    return result


def position(csc: Any, entry: int) -> tuple[int, int]:
    """Row and column of an entry of a csc_matrix."""
    return int(csc.indices[entry]), int(np.searchsorted(csc.indptr, entry, side="right")) - 1


def _is_its_mirror(full: Any, column: Any) -> bool:
    """Whether a csc_matrix is its own transpose; column: of each entry."""
    if full.data.size <= _FEW_ENTRIES:  # of which scipy's transpose takes five times as long
        order = full.indices.argsort(kind="stable")  # by row, then column
        return bool((column[order] == full.indices).all() and (full.indices[order] == column).all()
                    and (full.data[order] == full.data).all())
    mirror = full.T.tocsc()  # sorted, as it is made from rows
    return all(np.array_equal(getattr(full, part), getattr(mirror, part)) for part in ("indptr", "indices", "data"))


def upper_triangle(Q: MatrixLike, n: int, field: str = "Q", *, half: bool = False) -> Any:
    """The upper triangle of a matrix that is symmetric up to rounding; InvalidProblem with the entry if it is not.

    half: a matrix without any entry below the diagonal stands for the symmetric one. Entries (i, j) and (j, i) may
    differ by 1e-12 of √(mᵢ mⱼ), m the largest entry of row and column.
    """
    if not sp.issparse(Q):
        dense = _dense(Q, field)
        if dense.shape == (n, n) and np.isfinite(dense).all() and (dense == dense.T).all():
            return _entries(dense, upper=True)
    full = matrix(Q, field, n, n)
    column = np.repeat(np.arange(n), np.diff(full.indptr))
    if half and (full.indices <= column).all():
        return full
    if _is_its_mirror(full, column):
        upper = full.indices <= column
        counts = np.concatenate([[0], np.cumsum(upper)])
        return csc(full.data[upper], full.indices[upper], counts[full.indptr].astype(full.indptr.dtype), (n, n))
    difference = abs(full - full.T).tocoo()
    if difference.nnz:
        sizes = abs(full)
        root = np.sqrt(np.maximum(*(sizes.max(axis=axis).toarray().reshape(-1) for axis in (0, 1))))
        excess = difference.data - SYMMETRY * root[difference.row] * root[difference.col]
        worst = int(np.argmax(excess))
        if excess[worst] > 0:
            i, j = sorted((int(difference.row[worst]), int(difference.col[worst])))
            raise InvalidProblem(field, f"must be symmetric, as ({field} + {field}.T) / 2 is, and entry ({j}, {i}) "
                                 f"is {full[j, i]}", index=(i, j), value=full[i, j])
    upper = sp.triu(full, format="csc")
    upper.sort_indices()
    return upper


def mirrored(upper: Any) -> Any:
    """Both triangles of a symmetric matrix, as a coo_matrix."""
    entries = sp.coo_matrix(upper)
    off = entries.row != entries.col
    row = np.concatenate([entries.row, entries.col[off]])
    column = np.concatenate([entries.col, entries.row[off]])
    return sp.coo_matrix((np.concatenate([entries.data, entries.data[off]]), (row, column)), shape=upper.shape)


def shortened(name: str) -> str:
    """The name as far as a problem may have one."""
    if not isinstance(name, str):
        raise InvalidProblem("name", "must be a string", value=repr(name))
    return name.encode(errors="replace")[:LONGEST_PROBLEM_NAME].decode(errors="ignore")


class LCQP:
    """min ½ zᵀQz + gᵀz + c0  s.t.  A z + b = 0,  C z + d ≥ 0,  0 ≤ L z + l ⊥ R z + r ≥ 0.

    Q: n × n, symmetric, both triangles, or None for zero; may be indefinite: see Solution.second_order.
    g: n ≥ 1 entries; its size defines n.
    A, b: n_e × n and n_e entries; without b it is zero. C, d: n_i × n and n_i entries. L, l, R, r: n_c × n and
    n_c entries, L and R together.
    c0: added to the objective. z0: n entries, where to start; None leaves that to the solver.
    name: for logs and dashboards; shortened to 256 bytes.

    Matrices are dense (a vector is one row), nested lists or any scipy.sparse; all numbers must be finite.
    Raises InvalidProblem with field, index and bound. Everything is copied: what the arrays do later changes
    nothing. The attributes have the same names; matrices are csc_matrix, Q its upper triangle; they are read-only
    by convention.
    """

    def __init__(self, Q: MatrixLike | None, g: ArrayLike, *,
                 A: MatrixLike | None = None, b: ArrayLike | None = None,
                 C: MatrixLike | None = None, d: ArrayLike | None = None,
                 L: MatrixLike | None = None, l: ArrayLike | None = None,
                 R: MatrixLike | None = None, r: ArrayLike | None = None,
                 c0: float = 0.0, z0: ArrayLike | None = None, name: str = "") -> None:
        self.g: Vector = vector(g, "g")
        n = self.g.size
        if n == 0:
            raise InvalidProblem("g", "must have at least one entry", value="0 entries")
        self.Q: Any = twin(_empty(n, n)) if Q is None else upper_triangle(Q, n)
        self.A, self.b = _rows(A, b, "A", "b", n)
        self.C, self.d = _rows(C, d, "C", "d", n)
        self.L, self.l = _rows(L, l, "L", "l", n)
        self.R, self.r = _rows(R, r, "R", "r", n)
        if self.l.size != self.r.size:
            raise InvalidProblem("R", f"must have {self.l.size} rows, as many as L", value=f"{self.r.size} rows")
        self.c0: float = float(vector(c0, "c0", 1)[0])
        self.z0: Vector | None = None if z0 is None else vector(z0, "z0", n, " (n)")
        self.name: str = shortened(name)

    @property
    def n(self) -> int:
        """Number of variables."""
        return int(self.g.size)

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """Variables n, equalities n_e, inequalities n_i, pairs n_c."""
        return self.n, int(self.b.size), int(self.d.size), int(self.l.size)

    def objective(self, z: ArrayLike) -> float:
        """½ zᵀQz + gᵀz + c0 at z, n entries."""
        point = vector(z, "z", self.n)
        upper = self.Q @ point
        return float(point @ upper - 0.5 * (self.Q.diagonal() * point) @ point + self.g @ point + self.c0)

    def replaced(self, **parts: Any) -> LCQP:
        """The same problem with some attributes replaced by ones that are already checked."""
        other: LCQP = twin(self)
        other.__dict__.update(parts)
        return other

    def named(self, name: str) -> LCQP:
        """The same problem by this name."""
        short = shortened(name)
        return self if self.name == short else self.replaced(name=short)

    def __repr__(self) -> str:
        n, n_e, n_i, n_c = self.sizes
        name = f" {self.name!r}" if self.name else ""
        return f"<LCQP{name}: {n} variables, {n_e} equalities, {n_i} inequalities, {n_c} pairs>"

    def _repr_html_(self) -> str:
        n, n_e, n_i, n_c = self.sizes
        rows = [("size", f"{n} variables, {n_e} equalities, {n_i} inequalities, {n_c} pairs")]
        rows += [(letter, _described(getattr(self, letter))) for letter in "QACLR" if getattr(self, letter).nnz]
        rows += [(letter, _described(getattr(self, letter))) for letter in "gbdlr" if np.any(getattr(self, letter))]
        return table(f"LCQP {self.name}".strip(), rows)


def _described(part: Any) -> str:
    """Shape, entries, and the smallest and largest size of what is not zero."""
    values = np.abs(part.data if sp.issparse(part) else part)
    values = values[values > 0.0]
    shape = " × ".join(map(str, part.shape))
    return f"{shape}, {values.size} not zero" + (f", of size {values.min():.3g} to {values.max():.3g}" if values.size
                                                 else "")


def _rows(values: MatrixLike | None, offsets: ArrayLike | None, field: str, offset_field: str,
          n: int) -> tuple[Any, Vector]:
    if values is None:
        if offsets is not None and np.size(offsets):
            raise InvalidProblem(offset_field, f"must be empty, as there is no {field}",
                                 value=f"{np.size(offsets)} entries")
        return twin(_empty(0, n)), np.zeros(0)
    rows = matrix(values, field, n)
    count = rows.shape[0]
    if offsets is None:
        return rows, np.zeros(count)
    return rows, vector(offsets, offset_field, count, f", as many as {field} has rows")


def changed(problem: LCQP, changes: Mapping[str, Any]) -> LCQP:
    """By vectors and values of matrices by their letters."""
    parts: dict[str, Any] = {}
    for name, value in changes.items():
        if name in "QACLR":
            old = getattr(problem, name)
            parts[name] = csc(np.asarray(value), old.indices, old.indptr, old.shape)
        else:
            parts[name] = value if name == "c0" else np.asarray(value)
    return problem.replaced(**parts)


def problem_of(parts: Mapping[str, Any]) -> LCQP:
    """Of c0, vectors and matrices (data, indices, indptr, rows) by their letters."""
    vectors = {name: np.array(parts[name]) for name in "gbdlr"}
    n = vectors["g"].size
    matrices = {}
    for name in "QACLR":
        data, indices, indptr, rows = parts[name]
        if rows:
            matrices[name] = csc(np.array(data), np.array(indices, dtype=np.int32), np.array(indptr, dtype=np.int32),
                                 (rows, n))
    return LCQP(None, vectors["g"], c0=parts["c0"]).replaced(**vectors, **matrices)
