"""Disjunctions of pyomo.gdp as pairs, without a big M: TransformationFactory("marble.pairs").

A disjunct's constraints may be violated by its slack u ≥ 0, and of the slacks of a disjunction one is zero: of two by
0 ≤ u₁ ⊥ u₂ ≥ 0, of more by weights, Σ w = 1, 0 ≤ w_k ⊥ u_k ≥ 0. Where a disjunct has no constraints nothing is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pyomo.core
from pyomo.common.modeling import unique_component_name
from pyomo.core import Block, Constraint, LogicalConstraint, Transformation, TransformationFactory, Var, value
from pyomo.core.expr.visitor import identify_variables
from pyomo.gdp import Disjunct, Disjunction
from pyomo.mpec import Complementarity, complements

from marble.errors import InvalidProblem


def _disjunctions(block: Any) -> Iterator[Any]:
    return block.component_data_objects(Disjunction, active=True, descend_into=Block)  # type: ignore[no-any-return]


def _constraints(block: Any) -> Iterator[Any]:
    return block.component_data_objects(Constraint, active=True, descend_into=Block)  # type: ignore[no-any-return]


def _forced(disjunct: Any) -> bool | None:
    """Whether it was fixed to hold, or not to."""
    indicator = disjunct.binary_indicator_var
    if not disjunct.active or (indicator.fixed and indicator.value < 0.5):
        return False
    return True if indicator.fixed else None


def _is_empty(disjunct: Any) -> bool:
    return not any(_constraints(disjunct)) and not any(_disjunctions(disjunct))


def _refuse_other_uses(model: Any) -> None:
    """The choice is all that an indicator may be for: no pair has one."""
    logical = next(model.component_data_objects(LogicalConstraint, active=True, descend_into=(Block, Disjunct)), None)
    if logical is not None:
        raise InvalidProblem(f"logical constraint {logical.name}", "must not be there: pairs have no indicators")
    disjuncts = model.component_data_objects(Disjunct, descend_into=(Block, Disjunct))
    indicators = {id(disjunct.binary_indicator_var) for disjunct in disjuncts}
    for constraint in model.component_data_objects(Constraint, active=True, descend_into=(Block, Disjunct)):
        for variable in identify_variables(constraint.body):
            if id(variable) in indicators:
                raise InvalidProblem(f"constraint {constraint.name}", "must not have an indicator: pairs have none",
                                     value=variable.name)


@TransformationFactory.register("marble.pairs", doc="Disjunctions as complementarity conditions, without a big M")
class DisjunctionsToPairs(Transformation):  # type: ignore[misc]
    """apply_to(model): what was a disjunction is a block of variables, constraints and complementarity conditions.

    A disjunct whose indicator is fixed holds, or is left out. InvalidProblem names a logical constraint, a constraint
    that has an indicator, and a disjunction of which nothing is left.
    """

    def _apply_to(self, model: Any, **words: Any) -> None:
        if words:
            raise InvalidProblem("marble.pairs", "has no options", value=", ".join(sorted(words)))
        _refuse_other_uses(model)
        self._made = Block()
        model.add_component(unique_component_name(model, "marble_pairs"), self._made)
        self._made.slack = Var(pyomo.core.Any, dense=False)
        self._made.weight = Var(pyomo.core.Any, dense=False)
        self._made.rows = Constraint(pyomo.core.Any)
        self._made.pairs = Complementarity(pyomo.core.Any)
        for disjunction in list(_disjunctions(model)):
            self._turn(disjunction, 0)

    def _turn(self, disjunction: Any, slack_around: Any) -> None:
        """One of its disjuncts holds up to the slack of what is around it."""
        chosen = [(d, forced) for d in disjunction.disjuncts if (forced := _forced(d)) is not False]
        if not chosen:
            raise InvalidProblem(f"disjunction {disjunction.name}", "must have a disjunct that may hold")
        if all(forced is None for _, forced in chosen) and any(_is_empty(d) for d, _ in chosen):
            chosen = []  # one without constraints always holds
        certain = [d for d, forced in chosen if forced] or [d for d, _ in chosen[:1] if len(chosen) == 1]
        free = [] if certain else [d for d, _ in chosen]
        for disjunct in certain:
            self._relax(disjunct, slack_around)
        slacks = [self._made.slack.add(d.name) for d in free]
        for disjunct, slack in zip(free, slacks, strict=True):
            self._relax(disjunct, slack + slack_around)
        if len(free) == 2:
            self._made.pairs.add(disjunction.name, complements(slacks[0] >= 0, slacks[1] >= 0))
        elif free:
            weights = [self._made.weight.add(d.name) for d in free]
            self._made.rows[disjunction.name] = sum(weights) == 1
            for disjunct, weight, slack in zip(free, weights, slacks, strict=True):
                self._made.pairs.add(disjunct.name, complements(weight >= 0, slack >= 0))
        disjunction.deactivate()
        for disjunct in disjunction.disjuncts:
            disjunct._deactivate_without_fixing_indicator()  # as Pyomo's own transformations do

    def _relax(self, disjunct: Any, slack: Any) -> None:
        for inner in list(_disjunctions(disjunct)):
            self._turn(inner, slack)
        for constraint in _constraints(disjunct):
            low, body, high = constraint.to_bounded_expression()
            if low is not None:
                self._made.rows[constraint.name, "low"] = body + slack >= low
            if high is not None:
                self._made.rows[constraint.name, "high"] = body - slack <= high


def choose(model: Any) -> None:
    """Sets the indicators of a model's disjunctions by the values of its variables.

    model: as it was before the transformation, or after it. In each disjunction the disjunct is chosen whose
    constraints are violated least; of nested ones those of disjuncts that were chosen.
    """
    for disjunction in model.component_data_objects(Disjunction, descend_into=(Block, Disjunct)):
        open_ones = [d for d in disjunction.disjuncts if _unless_fixed(d)]
        best = min([d for d in open_ones if d.indicator_var.fixed] or open_ones, key=_violation, default=None)
        for disjunct in disjunction.disjuncts:
            if not disjunct.indicator_var.fixed:
                disjunct.indicator_var.set_value(disjunct is best)


def _unless_fixed(disjunct: Any) -> bool:
    return not disjunct.indicator_var.fixed or bool(disjunct.indicator_var.value)


def _violation(disjunct: Any) -> float:
    largest = 0.0
    for constraint in disjunct.component_data_objects(Constraint, descend_into=Block):
        if not constraint.active:
            continue
        body = value(constraint.body)
        if constraint.has_lb():
            largest = max(largest, value(constraint.lower) - body)
        if constraint.has_ub():
            largest = max(largest, body - value(constraint.upper))
    for inner in disjunct.component_data_objects(Disjunction, descend_into=Block):
        largest = max(largest, min(map(_violation, inner.disjuncts)))
    return largest
