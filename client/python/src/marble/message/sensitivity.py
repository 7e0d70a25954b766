"""Derivatives that are asked for and told, as messages."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from marble.base import contract
from marble.base.tables import VALUES, VECTORS
from marble.errors import FailedPrecondition
from marble.message.wire import Encoder
from marble.model import derivatives
from marble.model.derivatives import Asked, SensitivityAnswer
from marble.model.lcqp import Vector

_NUMBERS: Final = {**VECTORS, **VALUES}
_ANSWER: Final = dict(zip(derivatives.ANSWER, (
    "z", "equality_multipliers", "inequality_multipliers", "complementarity_multipliers_l",
    "complementarity_multipliers_r"), strict=True))


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
            ("losses", "LossesRequest", asked.losses, ("weights", _arrays("AnswerVectors", _ANSWER, asked.weights)))):
        if count:
            part = Encoder(kind)
            part.others(contract.message(kind)(count=count))
            part.message(*inner)
            whole.message(field, part)
    return whole


def _error(fault: Any) -> FailedPrecondition:
    value = f" = {fault.value}" if fault.value else ""
    place = f"{fault.field}[{fault.index}]" if fault.HasField("index") else fault.field
    return FailedPrecondition(f"{place}{value}: {fault.bound}")


def answer(message: Any, arrays: dict[str, Any], path: str) -> SensitivityAnswer:
    """A Sensitivity whose arrays stand under `path` in `arrays`."""
    if message.HasField("error"):
        return SensitivityAnswer(_error(message.error))

    def array(name: str) -> Vector:
        values: Vector = arrays.get(path + name, np.zeros(0))
        return values

    def indices(values: Any) -> Any:
        return np.fromiter(values, np.int32, len(values))

    rows = error = None
    if message.HasField("rows"):
        if message.rows.HasField("error"):
            error = _error(message.rows.error)
        else:
            rows = derivatives.response(*(array("rows." + name)
                                          for name in ("values", "free", "response", "z", "columns")))
    count = len(message.changes.holds)
    losses = array("gradients.numbers.gradient").size // max(1, array_size(arrays, path))
    return SensitivityAnswer(
        None, indices(message.weak_inequalities), indices(message.biactive_pairs), rows, error,
        derivatives.by_part({letter: array("changes.vectors." + name) for letter, name in _ANSWER.items()}, count),
        np.fromiter(message.changes.holds, np.bool_, count), indices(message.changes.missing),
        derivatives.by_part({letter: array("gradients.numbers." + name) for letter, name in _NUMBERS.items()}, losses),
        indices(message.gradients.missing), message.factorizations, message.back_substitutions)


def array_size(arrays: dict[str, Any], path: str) -> int:
    """n, of the answer that a Sensitivity belongs to."""
    return int(arrays.get(path.removesuffix("sensitivity.") + "z", np.zeros(0)).size)
