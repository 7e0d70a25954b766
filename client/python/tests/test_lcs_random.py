"""Random calls of marble.lcs, valid and hostile ones; MARBLE_LCS_RUNS and MARBLE_LCS_SEED set their number and seed."""

from __future__ import annotations

import collections
import dataclasses
import os

import lcs_random
import numpy as np
import pytest

from marble.lcs import LCS, Planner

pytest.importorskip("marble._core")

RUNS, SEED = (int(os.environ.get(f"MARBLE_LCS_{name}", default)) for name, default in (("RUNS", 400), ("SEED", 1)))


def test_every_call_ends_with_a_checked_result_or_an_error_that_names_its_argument():
    counts = collections.Counter()
    for index in range(RUNS):
        target, outcome, plans = lcs_random.call(SEED, index, sorted(lcs_random.TARGETS))
        counts[target, outcome] += 1
        counts["plans"] += plans
    if RUNS >= 400:  # each target has valid and hostile calls, and most valid steps have feasible plans
        for target in lcs_random.TARGETS:
            assert counts[target, "accepted"] > 0, counts
            assert counts[target, "refused"] > 0 or target in ("step", "threads"), counts
        assert counts["plans"] > counts["step", "accepted"], counts


def test_the_check_of_plans_finds_what_is_wrong():
    random = np.random.default_rng(3)
    lcs = LCS(**lcs_random.system(random, (2, 1, 2)))
    task, last = lcs_random.problem(random, 2, 1), np.zeros(1)
    x0 = random.normal(size=2)
    with Planner(lcs, **task, server="local") as planner:
        plan = planner.step(x0, last_u=last)
    assert lcs_random.check_plan(plan, lcs, x0, task, last)
    for changes, words in (({"x": plan.x + 0.1}, "x0"), ({"lam": plan.lam + 0.1}, "dynamics"),
                           ({"u": plan.u + 1e4}, "dynamics"), ({"objective": plan.objective + 1}, "objective"),
                           ({"u": plan.u[1:]}, "shapes"),
                           ({"start_objective": plan.objective - 1}, "above that of the start")):
        with pytest.raises(lcs_random.Found, match=words):
            lcs_random.check_plan(dataclasses.replace(plan, **changes), lcs, x0, task, last)
