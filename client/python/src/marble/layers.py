"""An LCQP as a function of its numbers with derivatives, on numpy's arrays: for marble.torch and marble.jax."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from marble.base.tables import MATRICES
from marble.calls.batch import BatchItem
from marble.calls.sensitivity import Sensitivity
from marble.client import Client, solve
from marble.errors import InvalidArgument
from marble.message import requests
from marble.model import lcqp
from marble.model.derivatives import ANSWER, LETTERS
from marble.model.lcqp import LCQP
from marble.model.problem import Problem, compiled
from marble.model.solution import Solution, warn_if_almost

Array = NDArray[np.float64]
_SINGLE: Final = 1


class Layer:
    """The answer of an LCQP of fixed sizes and patterns, as a function of some of its numbers.

    problem: all that is no parameter. parameters: letters of the equation: g, b, d, l, r, and of a matrix the values of
    its stored entries in the order of LCQP (of Q the upper triangle): explicit zeros are part of a pattern. outputs: of
    z, y, nu, xi, eta. start: an answer from which every solve starts; none: cold. So the same numbers always give the
    same answer. client: a marble.Client; none: as marble.solve. options, or any option by its name.

    Each number is an array of its part's size, or with one more axis in front: one problem a row. An answer that is not
    solved raises Unsolved.
    """

    def __init__(self, problem: LCQP | Problem, parameters: Sequence[str], *, outputs: Sequence[str] = ("z",),
                 start: Solution | None = None, client: Client | None = None,
                 options: Mapping[str, Any] | None = None, **more_options: Any) -> None:
        self.problem = compiled(problem)
        self.parameters, self.outputs = tuple(parameters), tuple(outputs)
        for names, known, field in ((self.parameters, LETTERS, "parameters"), (self.outputs, ANSWER, "outputs")):
            for name in names:
                if name not in known or names.count(name) > 1:
                    raise InvalidArgument(field, f"must be different ones of {', '.join(known)}", value=repr(name))
        self._start, self._client, self._options = start, client, requests.merged(options, more_options)
        n, n_e, n_i, n_c = self.problem.sizes
        self.answer_sizes = dict(zip(ANSWER, (n, n_e, n_i, n_c, n_c), strict=True))
        """How many numbers z, y, nu, xi and eta have."""
        self.sizes = tuple(part.nnz if name in MATRICES else part.size
                           for name in self.parameters for part in [getattr(self.problem, name)])
        """How many numbers each parameter has."""

    def problems(self, numbers: Sequence[ArrayLike]) -> tuple[list[LCQP], tuple[int, ...]]:
        """A problem for each row of numbers, and the shape of the rows: (k,), or () without such an axis."""
        self.check_shapes([np.shape(values) for values in numbers])
        arrays = [lcqp.numbers(values, name) for name, values in zip(self.parameters, numbers, strict=True)]
        rows = {array.shape[0] for array in arrays if array.ndim == 2 and array.shape[0] != _SINGLE}
        if len(rows) > 1:
            raise InvalidArgument("numbers", "must have as many rows as the others", value=sorted(rows))
        shape = tuple(rows) or ((_SINGLE,) if any(array.ndim == 2 for array in arrays) else ())
        count = shape[0] if shape else _SINGLE
        full = [np.broadcast_to(array, (count, array.shape[-1])) for array in arrays]
        return [self._with([array[row] for array in full]) for row in range(count)], shape

    def check_shapes(self, shapes: Sequence[tuple[int, ...]]) -> None:
        """InvalidArgument unless there is one for each parameter, of a problem or of rows of them."""
        if len(shapes) != len(self.parameters):
            raise InvalidArgument("numbers", f"must be of {', '.join(self.parameters)}", value=f"{len(shapes)} arrays")
        for name, shape, size in zip(self.parameters, shapes, self.sizes, strict=True):
            if len(shape) not in (1, 2) or shape[-1] != size:
                raise InvalidArgument(name, f"must have the shape ({size},) or (rows, {size})", value=shape)

    def _with(self, numbers: Sequence[Array]) -> LCQP:
        parts: dict[str, Any] = {}
        for name, values in zip(self.parameters, numbers, strict=True):
            old = getattr(self.problem, name)
            new = lcqp.vector(values, name)
            parts[name] = lcqp.csc(new, old.indices, old.indptr, old.shape) if name in MATRICES else new
        return self.problem.replaced(**parts)

    def solve(self, problems: Sequence[LCQP]) -> list[Solution]:
        """Their answers, solved; raises Unsolved where one is not, and warns of one that is AlmostSolved."""
        answers = self._answers(problems)
        for answer in answers:
            warn_if_almost(answer)
        return answers

    def _answers(self, problems: Sequence[LCQP]) -> list[Solution]:
        if self._client is not None and self._start is None and len(problems) > _SINGLE:
            found: dict[int, Solution] = {}
            for answer in self._client.batch([BatchItem(p) for p in problems], options=self._options):
                found[answer.index] = answer.result().raise_if_unsolved()
            return [found[index] for index in range(len(problems))]
        return [solve(p, server=self._client, options=self._options, warm_start=self._start).raise_if_unsolved()
                for p in problems]

    def answers(self, *numbers: ArrayLike) -> tuple[Array, ...]:
        """z, y, nu, xi and eta of each row, whichever are outputs: what gradients() needs."""
        problems, shape = self.problems(numbers)
        solved = self.solve(problems)
        sizes = self.answer_sizes
        return tuple(np.array([getattr(one, name) for one in solved]).reshape(*shape, sizes[name]) for name in ANSWER)

    def __call__(self, *numbers: ArrayLike) -> Array | tuple[Array, ...]:
        """The outputs: one array, or a tuple of several."""
        found = self.of_answers(self.answers(*numbers))
        return found[0] if len(found) == 1 else found

    def of_answers(self, answers: Sequence[Array]) -> tuple[Array, ...]:
        """The outputs among what answers() gave."""
        return tuple(answers[ANSWER.index(name)] for name in self.outputs)

    def gradients(self, numbers: Sequence[ArrayLike], answers: Sequence[ArrayLike],
                  weights: Sequence[ArrayLike]) -> tuple[Array, ...]:
        """Of a loss by the numbers, in their shapes, from its derivatives by the outputs: one factorization a row,
        here.

        answers: of the numbers, as answers() has them. Where rows or pairs are only just active the gradient is the
        branch's, one of several. Raises FailedPrecondition where a multiplier that counts is not unique, or the branch
        is flat.
        """
        problems, shape = self.problems(numbers)
        count = len(problems)
        vectors = [lcqp.numbers(values, name).reshape(count, self.answer_sizes[name])
                   for name, values in zip(ANSWER, answers, strict=True)]
        by = {name: np.broadcast_to(lcqp.numbers(values, name), (*shape, self.answer_sizes[name]))
              .reshape(count, self.answer_sizes[name]) for name, values in zip(self.outputs, weights, strict=True)}
        rows = []
        for k, problem in enumerate(problems):
            sensitivity = Sensitivity.at(problem, *(values[k] for values in vectors))
            rows.append(sensitivity.vjp(**{name: values[k] for name, values in by.items()}))
        gradients = []
        for name, values, size in zip(self.parameters, numbers, self.sizes, strict=True):
            whole = np.array([row[name] for row in rows]).reshape(count, size)
            given = np.shape(values)
            if len(given) == 1:
                gradients.append(whole.sum(axis=0))
            else:
                gradients.append(whole if given[0] == count else whole.sum(axis=0, keepdims=True))
        return tuple(gradients)


__all__ = ["Layer"]
