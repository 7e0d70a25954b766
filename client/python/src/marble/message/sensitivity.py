"""Requests for derivatives of a solution as messages, and their results."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from marble.base import contract
from marble.base.tables import SOLUTION_VECTORS, VALUES, VECTORS
from marble.errors import FailedPrecondition, from_core
from marble.message import records
from marble.message.wire import Encoder
from marble.model import derivatives
from marble.model.derivatives import RESPONSE, Asked, SensitivityAnswer
from marble.model.lcqp import Vector

_NUMBERS: Final = {**VECTORS, **VALUES}


def _arrays(kind: str, fields: dict[str, str], parts: dict[str, Vector]) -> Encoder:
    part = Encoder(kind)
    for letter, values in parts.items():
        part.doubles(fields[letter], values)
    return part


def encoder(asked: Asked, matrix: Any) -> Encoder:
    """A SensitivityRequest; matrix: encodes a SparseMatrix."""
    whole = Encoder("SensitivityRequest")
    if asked.rows is not None:
        rows = Encoder("RowsRequest")
        rows.message("matrix", matrix(asked.rows))
        rows.doubles("proximal", asked.proximal)
        rows.doubles("gradient", asked.g)
        rows.others(contract.message("RowsRequest")(columns=asked.columns))
        whole.message("rows", rows)
    for field, kind, count, inner in (
            ("directions", "DirectionsRequest", asked.directions,
             ("numbers", _arrays("ProblemNumbers", _NUMBERS, asked.numbers))),
            ("losses", "LossesRequest", asked.losses,
             ("weights", _arrays("AnswerVectors", SOLUTION_VECTORS, asked.weights)))):
        if count:
            part = Encoder(kind)
            part.others(contract.message(kind)(count=count))
            part.message(*inner)
            whole.message(field, part)
    return whole


def _error(message: Any) -> FailedPrecondition:
    value = f" = {message.value}" if message.value else ""
    place = f"{message.field}[{message.index}]" if message.HasField("index") else message.field
    return FailedPrecondition(f"{place}{value}: {message.bound}")


def answer(message: Any, arrays: records.Arrays, path: str) -> SensitivityAnswer:
    """A Sensitivity whose arrays stand under `path` in `arrays`."""
    if message.HasField("error"):
        return SensitivityAnswer(_error(message.error))

    def array(name: str) -> Vector:
        return arrays.get(path + name, np.zeros(0))

    rows = error = None
    if message.HasField("rows"):
        if message.rows.HasField("error"):
            error = _error(message.rows.error)
        else:
            rows = tuple(array("rows." + name) for name in RESPONSE)
    n = arrays.get(path.removesuffix("sensitivity.") + "z", np.zeros(0)).size
    changes, gradients = message.changes, message.gradients
    return _answer(
        {letter: array("changes.vectors." + name) for letter, name in SOLUTION_VECTORS.items()},
        {letter: array("gradients.numbers." + name) for letter, name in _NUMBERS.items()}, n, rows,
        weak_inequalities=message.weak_inequalities, biactive_pairs=message.biactive_pairs, rows_error=error,
        active_set_constant=changes.active_set_constant, undefined_changes=changes.undefined,
        undefined_gradients=gradients.undefined, factorizations=message.factorizations,
        back_substitutions=message.back_substitutions)


def core_answer(values: dict[str, Any] | None, n: int) -> SensitivityAnswer | None:
    """The same of marble._core; n: the number of variables."""
    if values is None:
        return None
    for name in ("error", "rows_error"):
        if (error := values.get(name)) is not None:
            values[name] = from_core(*error)
    if values.get("error") is not None:
        return SensitivityAnswer(values["error"])
    rows = values.pop("rows", None)
    changes, gradients = ({part: np.asarray(numbers) for part, numbers in values.pop(name).items()}
                          for name in ("changes", "gradients"))
    if rows is not None:
        rows = [np.asarray(part, np.float64) for part in rows]
    return _answer(changes, gradients, n, rows, **values)


def _answer(changes: dict[str, Vector], gradients: dict[str, Vector], n: int, rows: Any,
            **others: Any) -> SensitivityAnswer:
    losses = gradients["g"].size // max(1, n)
    return records.of_core(SensitivityAnswer, others, rows=None if rows is None else derivatives.response(*rows),
                           changes=derivatives.by_part(changes, len(others["active_set_constant"])),
                           gradients=derivatives.by_part(gradients, losses))
