"""Conditions of Pyomo's models in a form that its writer of .nl files keeps: TransformationFactory("marble.nl").

A condition in such a file is with regard to a bound of a variable. pyomo.mpec names the variable that is one of the
condition's sides, and lets a bound that it has of its own take the place of the condition's; one that is fixed, or in
no row and no cost, has no number in the file. Such a side becomes a variable of its own here, which equals the first.
One with both bounds, low ≤ e ≤ high ⊥ F, which pyomo.mpec has wrong or not at all, becomes two: F = p − m,
0 ≤ e − low ⊥ p ≥ 0 and 0 ≤ high − e ⊥ m ≥ 0.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import pyomo.core
from pyomo.common.collections import ComponentSet
from pyomo.common.modeling import unique_component_name
from pyomo.core import (
    Block,
    Constraint,
    ConstraintList,
    Objective,
    Transformation,
    TransformationFactory,
    VarList,
    inequality,
    value,
)
from pyomo.core.expr.visitor import identify_variables
from pyomo.mpec import Complementarity, complements

from marble.errors import InvalidProblem

_OF_MPEC: Final = ("bv", "c", "bc", "v", "e")  # parts of a condition's block


def _conditions(model: Any) -> Iterator[Any]:
    return model.component_data_objects(Complementarity, active=True, descend_into=Block)  # type: ignore[no-any-return]


def _is_variable(body: Any) -> bool:
    return hasattr(body, "is_variable_type") and bool(body.is_variable_type())


def _has_other_bound(variable: Any, low: Any, high: Any) -> bool:
    """Whether pyomo.mpec would take a bound of the variable for the condition's, or the other way round."""
    own_low, own_high = variable.bounds
    return (low is not None and own_low is not None and own_low > value(low)) or \
        (high is not None and own_high is not None and own_high != value(high))


class OwnVariables:
    """What a model's conditions need to be written; on leaving, the models are as they were.

    models: any number. keep: leave it there, for a file that is written later.
    """

    def __init__(self, models: Sequence[Any], keep: bool = False) -> None:
        self._models, self._keep = list(models), keep
        self._made: list[tuple[Any, Any]] = []
        self._sides: list[tuple[Any, Any]] = []
        self._bounds: list[tuple[Any, Any, Any]] = []
        self._inactive: list[Any] = []

    def __enter__(self) -> OwnVariables:
        for model in self._models:
            self._take(model)
        return self

    def __exit__(self, *_: object) -> None:
        if self._keep:
            return
        for condition, sides in self._sides:
            condition._args = sides
        for condition in self._inactive:
            condition.activate()
        for model, made in self._made:
            model.del_component(made)
        for variable, low, high in self._bounds:
            variable.setlb(low)
            variable.setub(high)

    def _take(self, model: Any) -> None:
        conditions = [(condition, [condition._canonical_expression(side) for side in condition._args])
                      for condition in _conditions(model)]
        conditions = [(condition, sides) for condition, sides in conditions if all(len(side) == 3 for side in sides)]
        if not conditions:
            return
        for condition, _ in conditions:  # what an earlier mpec.nl made of it
            for name in _OF_MPEC:
                if condition.component(name) is not None:
                    condition.del_component(name)
        variables = [side[1] for _, sides in conditions for side in sides if _is_variable(side[1])]
        self._bounds += [(variable, variable.lower, variable.upper) for variable in ComponentSet(variables)]
        used = ComponentSet(
            variable for part in model.component_data_objects((Constraint, Objective), active=True, descend_into=Block)
            for variable in identify_variables(part.body if part.ctype is Constraint else part.expr))
        made = Block()
        model.add_component(unique_component_name(model, "marble_own"), made)
        made.variables, made.rows = VarList(), ConstraintList()
        made.conditions = Complementarity(pyomo.core.Any)
        self._made.append((model, made))
        for condition, sides in conditions:
            if self._with_both_bounds(made, condition, sides):
                continue
            given, args = condition._args, list(condition._args)
            for i, (low, body, high) in enumerate(sides):
                if not _is_variable(body) or not (body.fixed or body not in used or _has_other_bound(body, low, high)):
                    continue
                own = made.variables.add()
                own.set_value(body.value, skip_validation=True)
                made.rows.add(own == body)
                args[i] = own if low is None and high is None else inequality(low, own, high)
            if any(a is not b for a, b in zip(args, given, strict=True)):
                self._sides.append((condition, given))
                condition._args = tuple(args)

    def _with_both_bounds(self, made: Any, condition: Any, sides: Any) -> bool:
        for (low, body, high), (_, free, _) in (sides, sides[::-1]):
            if low is not None and high is not None:
                above, below = made.variables.add(), made.variables.add()
                made.rows.add(above - below == free)
                for distance, part, name in ((body - low, above, "low"), (high - body, below, "high")):
                    made.conditions.add((condition.name, name), complements(distance >= 0, part >= 0))
                condition.deactivate()
                self._inactive.append(condition)
                return True
        return False


@TransformationFactory.register("marble.nl", doc="Complementarity conditions in a form that .nl files keep")
class ConditionsForFiles(Transformation):  # type: ignore[misc]
    """apply_to(model): as mpec.nl, to write the file; conditions mean then what they say. It has no options."""

    def _apply_to(self, model: Any, **words: Any) -> None:
        if words:
            raise InvalidProblem("marble.nl", "has no options", value=", ".join(sorted(words)))
        with OwnVariables([model], keep=True):
            TransformationFactory("mpec.nl").apply_to(model)
