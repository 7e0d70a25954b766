"""Solutions as plain data and as pictures, objects as HTML for notebooks, and what is logged."""

from __future__ import annotations

import dataclasses
import json
import logging
import subprocess
import sys

import numpy as np
import pytest
from support import Absence, tiny, wait_until

import marble

_EVIL = "<script>alert(1)</script>"


@pytest.fixture(scope="module")
def answer():
    problem = marble.Problem(["slip", "force", _EVIL], name="contact").minimize(2 * np.eye(3), [-2, -4, -1])
    problem.add_pair("slip", "force").add_rows([[1, 1, 1]], -9, 9).bound("force", ub=1.5)
    return marble.solve(problem, server="local")


def test_a_solution_as_a_dict_is_json_with_every_attribute(answer):
    given = answer.to_dict()
    again = json.loads(json.dumps(given, allow_nan=False))
    assert again == given
    assert {field.name for field in dataclasses.fields(answer)} | {"s", "t", "kind", "what_to_try"} == set(given)
    assert given["z"] == answer.z.tolist() and given["status"] == "solved" and given["problem"] == "contact"
    assert given["row_duals"] == answer.row_duals.tolist() and given["s"] == answer.s.tolist()
    assert given["violations"] == dataclasses.asdict(answer.violations)
    assert given["options"]["path"] == "fast" and given["kind"] == "proved_optimal"
    assert given["variables"] == {"slip": 0, "force": 1, _EVIL: 2} and given["sensitivity"] is None


def test_what_is_not_finite_is_none(client):
    free = client.solve(marble.LCQP(None, [1.0, -1.0])).to_dict()
    assert free["status"] == "unbounded" and free["bound"] is None and len(free["certificate"]) == 2
    json.dumps(free, allow_nan=False)


def test_derivatives_and_conflicts_are_part_of_it():
    asked = marble.SensitivityRequest(directions=[{"g": [1.0, 0.0]}], losses=[{"z": [1.0, 0.0]}])
    given = marble.solve(tiny(), server="local", sensitivity=asked).to_dict()["sensitivity"]
    assert len(given["changes"]["z"]) == 1 and given["error"] is None and len(given["gradients"]["g"][0]) == 2
    impossible = marble.LCQP(None, [0.0], C=[[1.0], [-1.0]], d=[-2.0, 1.0])
    conflict = marble.Client("local").explain(impossible).to_dict()["conflict"]
    assert conflict["inequalities"] == [0, 1] and conflict["minimal"] is True
    json.dumps([given, conflict], allow_nan=False)


def test_a_solution_is_drawn_with_its_pairs(answer, monkeypatch):
    matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure = answer.plot()
    variables, pairs = figure.axes
    assert [label.get_text() for label in variables.get_xticklabels()] == ["slip", "force", _EVIL]
    np.testing.assert_array_equal(variables.lines[-1].get_ydata(), answer.z)
    assert [text.get_text() for text in pairs.get_legend().get_texts()] == ["s = 0: 1"]
    np.testing.assert_array_equal(pairs.lines[0].get_ydata(), answer.t)
    figure.canvas.draw()
    plain = marble.solve(np.eye(100), -np.ones(100), name="costs $x$ and $", server="local").plot()
    assert len(plain.axes) == 1
    plain.canvas.draw()
    pyplot.close("all")
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(marble.Unavailable, match=r"plot needs matplotlib: pip install 'marble-solver\[plot\]'"):
        answer.plot()


def test_sides_that_are_both_zero_or_neither_are_distinguished():
    pytest.importorskip("matplotlib", reason="matplotlib is not installed").use("Agg")
    from marble.model import solution_plot

    s, t = np.array([0.0, 0.0, 1.0, 1.0]), np.array([0.0, 2.0, 0.0, 3.0])
    figure = solution_plot.draw("t", np.zeros(1), [], s, t, 1e-6)
    assert [text.get_text() for text in figure.axes[1].get_legend().get_texts()] == [
        "s = 0: 1", "t = 0: 1", "s = t = 0: 1", "neither is 0: 1"]


def test_notebooks_show_tables_and_no_names_as_markup(client):
    problem = marble.Problem(["a", _EVIL], name=_EVIL).minimize(np.eye(2), [1e6, -2]).add_rows([[1, 1]], 1, 1)
    problem.add_pair(0, 1).bound(0, ub=4)
    shown = [problem._repr_html_(), problem.compile()._repr_html_(), client._repr_html_(),
             marble.Client("local")._repr_html_()]
    for html in shown:
        assert html.startswith("<table>") and html.endswith("</table>") and "<script>" not in html
    assert "1, 1 of them equalities" in shown[0] and "&lt;script&gt;" in shown[0] and "1 with bounds" in shown[0]
    assert "2 variables, 1 equalities, 1 inequalities, 1 pairs" in shown[1] and "of size 2 to 1e+06" in shown[1]
    assert client.address in shown[2] and "jobs" in shown[2]
    assert "in this process" in shown[3] and "jobs" not in shown[3]
    many = marble.Problem([f"x{i}" for i in range(9)])
    assert "x7, …" in many._repr_html_() and "x8" not in many._repr_html_()


def test_solutions_are_logged_where_the_program_wants_it(client, caplog):
    with caplog.at_level(logging.DEBUG, "marble"):
        client.solve(tiny())
        marble.solve(tiny(), server="local")
    said = [record.getMessage() for record in caplog.records if "solution of" in record.getMessage()]
    assert len(said) == 2 and all(text.startswith("solution of 'tiny', job ") for text in said)
    assert all("solved, objective 1" in text for text in said)
    caplog.clear()
    client.solve(tiny())
    assert not caplog.records


def test_a_lost_server_is_warned_of(open_session, start_server, caplog):
    server = start_server()
    session = open_session(server.address, tiny())
    assert session.update().solved
    server.kill()
    absence = Absence(server.address)
    absence.end()
    start_server(listen=server.address)
    assert wait_until(lambda: session.update(c0=1.0).solved and session.reopened == 1)
    said = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert said[-1] == "the session's server was lost; it is open again (1)"


def test_nothing_is_shown_by_itself():
    script = ("import logging, marble.connection.patience, marble\n"
              "marble.connection.patience.logger.warning('lost')\n"
              "assert [type(h).__name__ for h in logging.getLogger('marble').handlers] == ['NullHandler']")
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout == run.stderr == ""
