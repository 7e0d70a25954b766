"""The kinds of answers in words, and spent budgets: the tables of cases that all languages have."""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib

import numpy as np
import pytest

import marble
from marble.model.solution_kind import SolutionFacts

TABLES = pathlib.Path(__file__).resolve().parents[3] / "tests/answers"
CASES = json.loads((TABLES / "kinds.json").read_text("utf-8"))
BUDGETS = json.loads((TABLES / "budgets.json").read_text("utf-8"))


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["text"])
def test_a_kind_follows_the_table_of_cases(case):
    facts = {"gap": math.inf, **case["facts"], "status": marble.Status(case["facts"]["status"])}
    given = SolutionFacts(**facts)
    assert (given.kind.value, given.text, given.what_to_try) == (case["kind"], case["text"], case["what_to_try"])


def test_every_kind_has_a_case():
    assert {case["kind"] for case in CASES} == {kind.value for kind in marble.SolutionKind}


def contact(**options):
    return marble.solve(2 * np.eye(2), [-2, -4], L=[1, 0], R=[0, 1], server="local", **options)


def test_a_small_problem_is_printed_as_proved_with_the_nodes_of_its_tree():
    answer = contact()
    assert answer.kind is marble.SolutionKind.PROVED_OPTIMAL and answer.what_to_try == ""
    assert answer.nodes >= 1 and answer.open_nodes == 0
    text = repr(answer)
    assert "answer        proved optimal" in text and f"{answer.nodes} node" in text
    assert "what to try" not in text and "  proof " not in text


def test_a_local_answer_is_printed_with_what_to_try():
    answer = contact(max_small_problem_nodes=0)
    assert answer.kind is marble.SolutionKind.LOCAL_MINIMUM and answer.nodes == 0
    text = repr(answer)
    assert "answer        local minimum; no bound is known" in text
    assert "what to try   num_starts=8 searches 8 times" in text and "global_search=true searches" in text
    assert "num_starts=16 searches twice as often" in contact(max_small_problem_nodes=0, num_starts=8).what_to_try


@pytest.mark.parametrize("case", BUDGETS, ids=str)
def test_a_budget_is_spent_as_the_table_of_cases_says(case):
    work = {name: case[name] for name in ("options", "factorizations", "detail")}
    assert dataclasses.replace(contact(), **work).facts.budget_spent is case["spent"]


def test_with_global_the_proof_has_its_line():
    assert "  proof         proved optimal: bound" in repr(contact(global_search=True))
