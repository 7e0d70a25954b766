"""Problems of MATLAB's .mat files, with LCQPow's names for their parts.

    min ½ xᵀQx + gᵀx   s.t.   0 ≤ L x − lbL ⊥ R x − lbR ≥ 0,   lbA ≤ A x ≤ ubA,   lb ≤ x ≤ ub

SciPy reads the versions 4 to 7, h5py version 7.3, which is HDF5; both in a process of its own.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import os
import pathlib
import sys
import warnings
import zipfile
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from marble.base import bounded_process
from marble.base.lazy import lazy
from marble.errors import InvalidProblem, Unavailable
from marble.model.lcqp import Vector
from marble.model.problem import Problem

sp: Any = lazy("scipy.sparse")

_NAMES: Final = ("Q", "g", "A", "lbA", "ubA", "lb", "ub", "L", "R", "lbL", "ubL", "lbR", "ubR", "x0")
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_HEAD: Final = 520  # bytes of a file that say what it is
_REFUSED: Final = 3  # exit code
_ANY_FILE, _BYTES_A_BYTE, _MOST_ROWS = 64 << 20, 100, 1 << 20  # what an array may unpack to; client/FORMATS.md
_NO_DOUBLES: Final = "must be of class double, full or sparse"
_NO_MATLAB: Final = "cannot be read as a MATLAB file"


def load(path: str | os.PathLike[str]) -> Problem:
    """The problem in a .mat file of version 4, 5, 6, 7 or, where h5py is installed, 7.3.

    Matrices Q (n × n), A, L and R (n columns), dense or sparse; vectors g, lbA, ubA, lb, ub, lbL, ubL, lbR, ubR and x0,
    rows or columns; all of class double. Q and g are required. Absent bounds are infinite, absent lbL and lbR zero.
    Rows of the result are those of A, then those of L and R that ubL and ubR bound. Other variables are ignored.
    Raises InvalidProblem with the variable as its field, Unavailable without h5py, OSError where there is no file.
    """
    path = pathlib.Path(path).resolve()
    return _problem(_tables(path), path.stem)


def _is_hdf5(head: bytes) -> bool:
    return head.startswith((b"MATLAB 7.3", _HDF5)) or head[512:520] == _HDF5


def _tables(path: pathlib.Path) -> dict[str, Any]:
    """The file's variables by name: dense arrays and csc_matrix, each of two dimensions."""
    with path.open("rb") as stream:
        is_hdf5 = _is_hdf5(stream.read(_HEAD))
    if is_hdf5 and importlib.util.find_spec("h5py") is None:
        error = Unavailable("is of MATLAB 7.3 and needs the package h5py to be read: pip install h5py")
        error.lost = False
        raise error
    try:
        done = bounded_process.run(__name__, path)
    except bounded_process.Failed as failed:
        raise InvalidProblem("", str(failed)) from None
    try:
        if done.returncode == _REFUSED:
            field, index, value, bound = json.loads(done.stdout)
            raise InvalidProblem(field, bound, index=index, value=value)
        if done.returncode != 0:
            said = done.stderr.decode(errors="replace").strip().splitlines() or ["it ended without a word"]
            raise InvalidProblem("", f"{_NO_MATLAB}: the reader failed ({done.returncode}): {said[-1]}")
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
            return {name: arrays[name] if name in arrays else
                    sp.csc_matrix(tuple(arrays[f"{name}.{part}"] for part in ("data", "indices", "indptr")),
                                  tuple(arrays[f"{name}.shape"]))
                    for name in _NAMES if name in arrays or f"{name}.shape" in arrays}
    except (KeyError, ValueError, zipfile.BadZipFile) as wrong:
        if isinstance(wrong, InvalidProblem):
            raise
        raise InvalidProblem("", f"{_NO_MATLAB}: the reader wrote no result ({wrong})") from None


# The problem of the variables.

def _size(table: Any) -> str:
    return f"{table.shape[0]} x {table.shape[1]}"


@contextlib.contextmanager
def _renamed(**names: str) -> Iterator[None]:
    """Errors of the builder in the file's names."""
    try:
        yield
    except InvalidProblem as error:
        raise InvalidProblem(names.get(error.field, error.field), error.bound, index=error.index,
                             value=error.value) from None


class _Variables:
    def __init__(self, tables: dict[str, Any]) -> None:
        self._tables = tables

    def vector(self, name: str, size: int) -> Vector | None:
        """None where it is absent or empty."""
        table = self._tables.get(name)
        if table is None or 0 in table.shape:
            return None
        if table.shape not in ((1, size), (size, 1)):
            raise InvalidProblem(name, f"must have {size} entries", value=_size(table))
        dense = table.toarray() if sp.issparse(table) else table
        return np.asarray(dense, dtype=np.float64).reshape(-1)

    def rows(self, name: str, n: int) -> Any:
        """A matrix of n columns; without rows where it is absent."""
        table = self._tables.get(name)
        if table is None or table.shape[0] == 0:
            return np.zeros((0, n))
        if table.shape[1] != n:
            raise InvalidProblem(name, f"must have {n} columns, as many as Q", value=_size(table))
        return table


def _problem(tables: dict[str, Any], name: str) -> Problem:
    for needed in ("Q", "g"):
        if needed not in tables:
            raise InvalidProblem(needed, "is missing")
    found, (n, columns) = _Variables(tables), tables["Q"].shape
    if n != columns or n == 0:
        raise InvalidProblem("Q", "must be square, with at least one row", value=_size(tables["Q"]))
    problem = Problem(n, name)
    problem.minimize(tables["Q"], found.vector("g", n))
    A, left, right = (found.rows(letter, n) for letter in "ALR")
    count = left.shape[0]
    if right.shape[0] != count:
        raise InvalidProblem("R", f"must have {count} rows, as many as L", value=f"{right.shape[0]} rows")
    low, high = found.vector("lbA", A.shape[0]), found.vector("ubA", A.shape[0])
    if A.shape[0]:
        with _renamed(lb="lbA", ub="ubA"):
            problem.add_rows(A, low, high)
    problem.bound(None, found.vector("lb", n), found.vector("ub", n))
    for side, rows in (("L", left), ("R", right)):
        upper = found.vector(f"ub{side}", count)
        if upper is not None:
            with _renamed(A=side, ub=f"ub{side}"):
                problem.add_rows(rows, None, upper)
    shifts = [found.vector(limit, count) for limit in ("lbL", "lbR")]
    if count:
        with _renamed(l="lbL", r="lbR"):
            l, r = (None if shift is None else 0.0 - shift for shift in shifts)
            problem.add_pairs(left, right, l=l, r=r)
    with _renamed(z0="x0"):
        return problem.start_at(found.vector("x0", n))


# What follows runs in the process that reads.

def _why(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


@contextlib.contextmanager
def _reading(name: str, what: str = "cannot be read") -> Iterator[None]:
    """Whatever the library raises becomes an error of the variable."""
    try:
        yield
    except InvalidProblem:
        raise
    except MemoryError:
        raise InvalidProblem(name, "is too large for the file's length") from None
    except Exception as error:
        raise InvalidProblem(name, f"{what}: {_why(error)}") from None


def _most_numbers(length: int) -> int:
    return (_ANY_FILE + _BYTES_A_BYTE * length) // 8


def _check_shape(name: str, shape: tuple[int, ...], is_dense: bool, length: int) -> None:
    """Before anything is reserved, as the file may claim any size."""
    rows, numbers = _MOST_ROWS + _BYTES_A_BYTE * length // 8, _most_numbers(length)
    if len(shape) != 2 or not all(0 <= extent <= min(rows, 2**31 - 1) for extent in shape):
        raise InvalidProblem(name, f"must be a matrix or a vector with at most {rows} rows and columns, for the file's "
                             "length", value=" x ".join(str(extent) for extent in shape))
    if is_dense and shape[0] * shape[1] > numbers:
        raise InvalidProblem(name, f"must have at most {numbers} entries, for the file's length",
                             value=" x ".join(str(extent) for extent in shape))


def _check_columns(name: str, starts: Any, rows: Any, shape: tuple[int, int]) -> None:
    """Compressed columns, as compiled code indexes memory by them."""
    if starts.shape != (shape[1] + 1,) or rows.ndim != 1:
        raise InvalidProblem(f"{name}.jc", f"must have {shape[1] + 1} entries", value=f"{starts.size} entries")
    wrong = (starts[1:] < starts[:-1]) | (starts[1:] > rows.size)
    bad = np.array([0]) if starts[0] != 0 else np.flatnonzero(wrong)
    if bad.size:
        raise InvalidProblem(f"{name}.jc", f"must ascend from 0 to {rows.size} at most", index=int(bad[0]))
    bad = np.flatnonzero((rows[:starts[-1]] < 0) | (rows[:starts[-1]] >= shape[0]))
    if bad.size:
        raise InvalidProblem(f"{name}.ir", f"must be in [0, {shape[0]})", index=int(bad[0]), value=rows[bad[0]])


def _parts(name: str, data: Any, rows: Any, starts: Any, shape: tuple[int, int]) -> dict[str, Any]:
    """A sparse matrix as it is passed on."""
    _check_columns(name, starts, rows, shape)
    if data.dtype.kind not in "biuf" or data.shape != rows.shape:
        raise InvalidProblem(name, "must have as many values as row indices", value=f"{data.size}, {rows.size}")
    return {f"{name}.data": data.astype(np.float64), f"{name}.indices": rows.astype(np.int32),
            f"{name}.indptr": starts.astype(np.int32), f"{name}.shape": np.array(shape, dtype=np.int64)}


def _check_version_4(content: bytes) -> None:
    """Every variable ends within the file: SciPy would go back for ever where a size is negative."""
    at = 0
    while at < len(content):
        head = np.frombuffer(content[at:at + 20].ljust(20, b"\0"), dtype="<i4")
        kind, rows, columns, imaginary, letters = (int(number) for number in
                                                   (head if 0 <= head[0] <= 4999 else head.byteswap()))
        width = (8, 4, 4, 2, 2, 1)[kind // 10 % 10] if kind // 10 % 10 < 6 else 0
        if len(content) - at < 20 or min(kind, rows, columns, letters) < 0 or kind > 4999 or not width:
            raise InvalidProblem("", f"{_NO_MATLAB}: no variable of MATLAB 4 begins at byte {at}")
        at += 20 + letters + rows * columns * width * (2 if imaginary and kind % 10 != 2 else 1)
        if at > len(content):
            raise InvalidProblem("", f"{_NO_MATLAB}: ends too soon, {at - len(content)} bytes are missing")


def _by_scipy(content: bytes) -> dict[str, Any]:
    import scipy.io.matlab

    if content.startswith((b"# Created by Octave", b"Octave-1-")):
        raise InvalidProblem("", "is a file of Octave's own: must be written in MATLAB's format, by save -v7 FILE")
    if len(content) >= 4 and b"\0" in content[:4]:  # a small number; a later version begins with a text
        _check_version_4(content)
    elif content[126:128] not in (b"IM", b"MI"):
        raise InvalidProblem("", _NO_MATLAB)
    with _reading("", _NO_MATLAB):
        listed = scipy.io.whosmat(io.BytesIO(content))
    arrays: dict[str, Any] = {}
    for name in _NAMES:
        kinds = [(shape, kind) for known, shape, kind in listed if known == name]
        if len(kinds) > 1:
            raise InvalidProblem(name, "is there twice")
        for shape, kind in kinds:
            if kind not in ("double", "sparse", "logical"):
                raise InvalidProblem(name, _NO_DOUBLES, value=f"of class {kind}")
            _check_shape(name, shape, kind == "double", len(content))
            with _reading(name), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                warnings.simplefilter("error", scipy.io.matlab.MatReadWarning)
                value = scipy.io.loadmat(io.BytesIO(content), variable_names=[name])[name]
                if value.dtype.kind == "c":
                    raise InvalidProblem(name, "must be real", value="complex")
                if sp.issparse(value):
                    columns = value.tocsc()
                    arrays |= _parts(name, columns.data, columns.indices, columns.indptr, shape)
                elif kind == "double" and value.dtype.kind in "iuf":  # doubles may be stored as something smaller
                    arrays[name] = value.astype(np.float64)
                else:
                    raise InvalidProblem(name, _NO_DOUBLES, value=f"of class {kind}")
    return arrays


class _Hdf5:
    """A file of version 7.3: a matrix is a dataset, transposed; a sparse one a group of data, ir and jc."""

    def __init__(self, file: Any, length: int) -> None:
        self._file, self._length = file, length

    def arrays(self, name: str) -> dict[str, Any]:
        """The variable as it is passed on; nothing where there is none."""
        if self._file.get(name, getlink=True) is None:
            return {}
        found = self._member(self._file, name, name)
        kind, rows = bytes(found.attrs.get("MATLAB_class", b"double")), found.attrs.get("MATLAB_sparse")
        if kind != b"double" and not (kind == b"logical" and rows is not None):
            raise InvalidProblem(name, _NO_DOUBLES, value=f"of class {kind.decode(errors='replace')}")
        if rows is not None:
            starts = self._dataset(found, "jc", f"{name}.jc")[()]
            shape = int(rows), starts.size - 1
            _check_shape(name, shape, False, self._length)
            data, indices = (self._dataset(found, part, f"{name}.{part}")[()] if part in found else np.zeros(0)
                             for part in ("data", "ir"))  # a matrix without entries has neither
            return _parts(name, data, indices, starts, shape)
        dataset = self._dataset(self._file, name, name)
        if found.attrs.get("MATLAB_empty", 0):  # its entries are the extents
            extents = tuple(int(extent) for extent in dataset[()].ravel())
            _check_shape(name, extents, True, self._length)
            return {name: np.zeros(extents)}
        _check_shape(name, dataset.shape[::-1], True, self._length)
        if dataset.dtype != np.float64:
            raise InvalidProblem(name, _NO_DOUBLES, value=f"of type {dataset.dtype}")
        return {name: dataset[()].T}

    def _member(self, group: Any, name: str, field: str) -> Any:
        import h5py

        link = group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise InvalidProblem(field, "is missing" if link is None else "must be in the file, not a link")
        return group[name]

    def _dataset(self, group: Any, name: str, field: str) -> Any:
        """Real numbers that are in this file, of a number that fits its length."""
        import h5py

        found = self._member(group, name, field)
        if not isinstance(found, h5py.Dataset):
            raise InvalidProblem(field, _NO_DOUBLES, value="a group")
        if found.is_virtual or found.external:
            raise InvalidProblem(field, "must be in the file, not in another")
        if found.dtype.names or found.dtype.kind == "c":
            raise InvalidProblem(field.partition(".")[0], "must be real", value="complex")
        if found.dtype.kind not in "biuf":
            raise InvalidProblem(field, _NO_DOUBLES, value=f"of type {found.dtype}")
        if found.size > _most_numbers(self._length):
            raise InvalidProblem(field, "is too large for the file's length", value=f"{found.size} entries")
        return found


def _by_h5py(path: str, length: int) -> dict[str, Any]:
    import h5py

    with _reading("", _NO_MATLAB):
        file = h5py.File(path, "r")
    arrays: dict[str, Any] = {}
    with file:
        for name in _NAMES:
            with _reading(name):
                arrays |= _Hdf5(file, length).arrays(name)
    return arrays


def _read_here(path: str) -> int:
    content = pathlib.Path(path).read_bytes()
    is_hdf5 = _is_hdf5(content[:_HEAD])
    importlib.import_module("h5py" if is_hdf5 else "scipy.io.matlab")
    bounded_process.limit(len(content))
    packed = io.BytesIO()
    try:
        with _reading("", _NO_MATLAB):
            np.savez(packed, **(_by_h5py(path, len(content)) if is_hdf5 else _by_scipy(content)))
    except InvalidProblem as error:
        print(json.dumps([error.field, error.index, error.value, error.bound]))
        return _REFUSED
    sys.stdout.buffer.write(packed.getvalue())
    return 0


if __name__ == "__main__":
    sys.exit(_read_here(sys.argv[1]))
