"""Complex numbers are refused wherever numbers are read, and no part of them is dropped."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import scipy.sparse as sp
from support import tiny

import marble

COMPLEX = np.eye(2) * (1 + 1j)
FORMS = [COMPLEX, COMPLEX.tolist(), COMPLEX.astype(object), np.eye(2).astype(complex), sp.csc_matrix(COMPLEX),
         sp.coo_matrix(COMPLEX), sp.lil_matrix(COMPLEX), sp.dia_matrix(COMPLEX), sp.csr_array(COMPLEX)]


@pytest.fixture(autouse=True)
def _no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@pytest.mark.parametrize("values", FORMS, ids=lambda one: type(one).__name__)
def test_matrices(values):
    for name in "QACL":
        parts = {"Q": np.eye(2), **({"R": np.eye(2)} if name == "L" else {}), name: values}
        with pytest.raises(marble.InvalidProblem) as found:
            marble.LCQP(parts.pop("Q"), [1, 1], **parts)
        assert found.value.field == name
    builder = marble.Problem(2)
    for add in (lambda: builder.minimize(values), lambda: builder.add_rows(values, lb=0),
                lambda: builder.add_pairs(values, np.eye(2))):
        with pytest.raises(marble.InvalidProblem):
            add()


def test_vectors_updates_and_points():
    with pytest.raises(marble.InvalidProblem):
        marble.LCQP(np.eye(2), [1, 1j])
    with pytest.raises(marble.InvalidProblem):
        marble.LCQP(np.eye(2), [1, 1], c0=1j)
    with pytest.raises(marble.InvalidProblem):
        marble.Problem(2).minimize(np.eye(2), c0=1 + 0j)


def test_updates(client):
    with client.session(tiny()) as session:
        for changes in ({"g": [1, 1j]}, {"Q": COMPLEX}, {"Q": [1j, 2]}, {"z0": [0, 1j]}, {"c0": 1j}):
            with pytest.raises(marble.InvalidProblem):
                session.update(**changes)
        with pytest.raises(marble.InvalidArgument):
            session.update(time_limit_s=1j)
        assert session.update().solved


def test_samplers():
    with pytest.raises(marble.InvalidProblem):
        marble.Client("local").scenarios(tiny(), marble.Scenarios([0], {"g": np.array([[1j, 1], [1, 1]])}))


def test_nonlinear_functions():
    pytest.importorskip("marble._core")
    for values, slope in ((1, [1j]), (1j, [1.0]), (1, sp.csc_matrix([[1j]]))):
        with pytest.raises((marble.InvalidProblem, TypeError)):
            marble.nlp.solve(lambda x, v=values: {"objective": v, "equalities": [x[0]]},
                             lambda x, s=slope: {"gradient": [1.0], "equalities": s}, [1.0])
    with pytest.raises(marble.InvalidProblem):
        marble.nlp.solve(lambda x: {"objective": 0.0}, lambda x: {"gradient": [0.0]}, [1j])
