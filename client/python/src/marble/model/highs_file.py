"""Problems of MPS, QPS and LP files. HiGHS reads them (package highspy), in a process of its own."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import pathlib
import sys
import tempfile
from typing import Any, Final

import numpy as np

from marble.base import bounded_process
from marble.errors import Error, InvalidProblem

ENDINGS: Final = {".mps": ".mps", ".qps": ".mps", ".lp": ".lp"}  # and by which HiGHS knows the format
_PARTS: Final = ("cost", "offset", "maximize", "low", "high", "row_low", "row_high", "starts", "rows", "values",
                 "hessian_starts", "hessian_rows", "hessian_values", "discrete", "names")
_NO_MODULE, _REFUSED, _TOO_LARGE = 3, 4, 5  # exit codes


def is_one(path: str | os.PathLike[str]) -> bool:
    """Whether the path ends as such a file's does."""
    return pathlib.Path(path).suffix.lower() in ENDINGS


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The parts of the model, as arrays by name. InvalidProblem says what is wrong, OSError that it cannot be read."""
    path = pathlib.Path(path).resolve()
    if importlib.util.find_spec("highspy") is None:
        raise InvalidProblem("", "needs the package highspy to be read: pip install highspy")
    try:
        done = bounded_process.run(__name__, path)
    except bounded_process.Failed as error:
        raise InvalidProblem("", str(error)) from None
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines() or ["the reader ended without a word"]
        known = done.returncode in (_NO_MODULE, _REFUSED, _TOO_LARGE)
        raise InvalidProblem("", f"cannot be read by HiGHS: {said[-1]}" if known else
                             f"cannot be read by HiGHS, which failed ({done.returncode}): {said[-1]}")
    try:
        with np.load(io.BytesIO(done.stdout), allow_pickle=False) as parts:
            found = {name: parts[name] for name in _PARTS}
    except (KeyError, ValueError, OSError) as error:
        raise InvalidProblem("", f"cannot be read by HiGHS: {error}") from None
    if found["cost"].size == 0:
        raise InvalidProblem("", "must have a variable")
    discrete = np.flatnonzero(found["discrete"])
    if discrete.size:
        raise InvalidProblem(f"variable {found['names'][discrete[0]]}", "must be continuous: an LCQP's are")
    return found


def _parts(model: Any, continuous: Any, triangular: Any, maximize: Any) -> dict[str, Any]:
    lp, hessian = model.lp_, model.hessian_
    starts, rows, values = (np.asarray(part) for part in (hessian.start_, hessian.index_, hessian.value_))
    if hessian.dim_ and hessian.format_ == triangular:  # the lower one
        columns = np.repeat(np.arange(hessian.dim_), np.diff(starts))
        off = rows != columns
        rows, columns, values = (np.concatenate(part) for part in (
            (rows, columns[off]), (columns, rows[off]), (values, values[off])))
        order = np.lexsort((rows, columns))
        starts = np.searchsorted(columns[order], np.arange(hessian.dim_ + 1))
        rows, values = rows[order], values[order]
    return {"cost": lp.col_cost_, "offset": lp.offset_, "maximize": lp.sense_ == maximize, "low": lp.col_lower_,
            "high": lp.col_upper_, "row_low": lp.row_lower_, "row_high": lp.row_upper_, "starts": lp.a_matrix_.start_,
            "rows": lp.a_matrix_.index_, "values": lp.a_matrix_.value_, "hessian_starts": starts,
            "hessian_rows": rows, "hessian_values": values,
            "discrete": [kind != continuous for kind in lp.integrality_], "names": list(lp.col_names_)}


def _why(log: pathlib.Path) -> str:
    with contextlib.suppress(OSError):
        lines = [line.strip() for line in log.read_text(errors="replace").splitlines()]
        for line in lines:
            if line.startswith(("ERROR", "Error")):
                return line.partition(":")[2].strip() or line
    return "it is not in the format that its ending says"


def _read_here(path: str) -> int:
    """In the process of its own: writes the parts to standard output."""
    try:
        import highspy
    except ImportError as error:
        print(error, file=sys.stderr)
        return _NO_MODULE
    bounded_process.limit(os.stat(path).st_size)
    out = os.dup(1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # HiGHS says who it is
    with tempfile.TemporaryDirectory() as folder:
        link = pathlib.Path(folder) / f"model{ENDINGS[pathlib.Path(path).suffix.lower()]}"
        log = pathlib.Path(folder) / "log"
        link.symlink_to(path)
        try:
            highs = highspy.Highs()
            for name, value in (("log_to_console", False), ("log_file", str(log)), ("threads", 1)):
                highs.setOptionValue(name, value)
            if highs.readModel(str(link)) == highspy.HighsStatus.kError:
                print(_why(log), file=sys.stderr)
                return _REFUSED
            packed = io.BytesIO()
            np.savez(packed, **_parts(highs.getModel(), highspy.HighsVarType.kContinuous,
                                      highspy.HessianFormat.kTriangular, highspy.ObjSense.kMaximize))
        except MemoryError:
            print("it asks for too much memory, for its length", file=sys.stderr)
            return _TOO_LARGE
    with os.fdopen(out, "wb") as stream:
        stream.write(packed.getvalue())
    return 0


if __name__ == "__main__":
    try:
        sys.exit(_read_here(sys.argv[1]))
    except Error as problem:
        sys.exit(str(problem))
