"""What is handed out: wheel and sdist, the README's words, the program, the examples, the types."""

from __future__ import annotations

import email.parser
import os
import pathlib
import re
import shutil
import subprocess
import sys
import textwrap
import zipfile

import numpy as np
import pytest
from support import SERVER, clean_environment, random_problem, tiny

import marble
from marble import drawing, flights
from marble.hopper import Hopper

HERE = pathlib.Path(__file__).resolve().parent.parent
PACKAGE = pathlib.Path(marble.__file__).parent.parent


def _python(*arguments, server="", where=None, **more):
    environment = clean_environment(PYTHONPATH=str(PACKAGE), MPLBACKEND="Agg", **more)
    if server:
        environment["MARBLE_SERVER"] = server
    return subprocess.run([sys.executable, *map(str, arguments)], env=environment, cwd=where, capture_output=True,
                          text=True, timeout=200)


def test_the_quick_start_works_word_for_word(server, tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", (HERE / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 3
    (tmp_path / "quick_start.py").write_text("\n".join(blocks), encoding="utf-8")
    run = _python("quick_start.py", server=server.address, where=tmp_path)
    assert run.returncode == 0, run.stderr
    assert "solved" in run.stdout


def test_the_programs_of_the_page_about_solving_run(server, tmp_path):
    page = (HERE.parent / "SOLVING.md").read_text(encoding="utf-8")
    programs = re.findall(r"^    import marble\n(?:(?:    .*)?\n)+", page, re.MULTILINE)
    assert len(programs) == 2
    for program in programs:
        (tmp_path / "program.py").write_text(textwrap.dedent(program), encoding="utf-8")
        run = _python("program.py", server=server.address, where=tmp_path)
        assert run.returncode == 0, run.stderr


def test_the_demo_ends_in_a_picture(server, tmp_path):
    run = _python("-m", "marble", "demo", "plan.png", server=server.address, where=tmp_path)
    assert run.returncode == 0 and "hopper: solved" in run.stdout, run.stderr
    drawn = (tmp_path / "plan.png").is_file()
    assert drawn == ("drawn in plan.png" in run.stdout)
    assert drawn or "####" in run.stdout


@pytest.fixture
def programs_in_path(monkeypatch):
    folder = os.path.dirname(os.environ.get("MARBLE_BINARY", ""))
    monkeypatch.setenv("PATH", folder + os.pathsep + os.environ["PATH"])


@pytest.mark.parametrize("name", ["rocket", "gates"])
def test_a_flight_ends_in_a_picture(name, server, tmp_path, programs_in_path):
    run = _python("-m", "marble", "demo", name, server=server.address, where=tmp_path)
    assert run.returncode == 0 and f"{name}: solved" in run.stdout, run.stderr
    assert (tmp_path / f"{name}.png").is_file() == (f"drawn in {name}.png" in run.stdout)


def test_a_flights_trajectory_begins_and_ends_where_the_problem_says(client, programs_in_path):
    rocket = flights.trajectory(client.solve(flights.problem("rocket")).z, flights.ROCKET_STEP)
    assert rocket.shape == (40, 3) and rocket[0, :2] == pytest.approx([13.0, 25.5])
    assert rocket[-1, :2] == pytest.approx(flights.ROCKET_CATCH)
    gates = flights.trajectory(client.solve(flights.problem("gates")).z, flights.GATES_STEP)
    assert gates.shape == (30, 3) and gates[-1] == pytest.approx([6.0, 0.0, 1.0])
    for centre, _ in flights.GATES:
        nearest = np.linalg.norm(gates - np.array(centre), axis=1).min()
        assert nearest <= np.linalg.norm(flights.GATE_HALF_EXTENT) + 1e-6


def test_a_terminal_can_show_the_plan(client):
    hopper = Hopper(steps=20)
    picture = drawing.text(hopper, client.solve(hopper.problem()).z)
    assert picture.count("o") > 5 and "####" in picture


def test_the_program_solves_files_and_reports_bad_ones(server, tmp_path):
    marble.Problem.of(tiny()).save(tmp_path / "good.json")
    (tmp_path / "bad.json").write_text("{}")
    good = _python("-m", "marble", "solve", "good.json", server=server.address, where=tmp_path)
    assert good.returncode == 0 and "tiny: solved" in good.stdout
    limited = _python("-m", "marble", "solve", "good.json", "--option", "max_iterations=0", server=server.address,
                      where=tmp_path)
    assert limited.returncode == 1 and "iteration_limit" in limited.stdout
    bad = _python("-m", "marble", "solve", "bad.json", "good.json", server=server.address, where=tmp_path)
    assert bad.returncode == 2 and "bad.json: n: is missing" in bad.stderr and "tiny: solved" in bad.stdout
    info = _python("-m", "marble", "info", server=server.address)
    assert info.returncode == 0 and "workers" in info.stdout
    nobody = _python("-m", "marble", "--server", "127.0.0.1:1", "info")
    assert nobody.returncode == 3 and "127.0.0.1:1" in nobody.stderr


def test_a_server_runs_by_the_package_s_name(tmp_path):
    folder = pathlib.Path(SERVER).parent
    run = _python("-m", "marble", "server", "--version", PATH=f"{folder}{os.pathsep}{os.environ['PATH']}")
    assert run.returncode == 0 and run.stdout.split() == ["marble-server", marble.__version__], run.stderr
    nowhere = _python("-m", "marble", "server", PATH=str(tmp_path))
    assert nowhere.returncode == 3 and "no marble-server in PATH" in nowhere.stderr


@pytest.mark.parametrize(("name", "argument", "words"), [("hopper.py", "plan.png", "the foot presses in"),
                                                         ("mpc.py", "4", "solved")])
def test_the_examples_run(server, tmp_path, name, argument, words):
    run = _python(HERE / "examples" / name, argument, server=server.address, where=tmp_path)
    assert run.returncode == 0 and words in run.stdout, run.stderr


def test_the_benchmark_runs(tmp_path):
    run = _python(HERE / "benchmarks" / "encoding.py", where=tmp_path)
    assert run.returncode == 0, run.stderr
    titles, *rows = run.stdout.splitlines()
    assert titles.split()[:2] == ["request", "MB"] and len(rows) == 3
    figures = np.array([row.split() for row in rows], dtype=float)
    assert figures.shape == (3, 6) and (figures > 0).all(), "also what takes microseconds"
    growth = figures[1:, [0, 3]] / figures[:-1, [0, 3]]
    assert np.allclose(growth, 10, rtol=0.2), "requests and answers of 0.1, 1 and 10 MB"


def test_wheel_and_sdist_build_and_the_wheel_works_elsewhere(server, tmp_path):
    pytest.importorskip("build", reason="python3-build is not installed")
    source = tmp_path / "repository" / "client" / "python"
    shutil.copytree(HERE, source, ignore=shutil.ignore_patterns("build", "dist", "__pycache__", "*.egg-info"))
    shutil.copytree(HERE.parent.parent / "proto", tmp_path / "repository" / "proto")
    (tmp_path / "repository" / "deploy").mkdir()
    shutil.copy(HERE.parent.parent / "deploy" / "VERSION", tmp_path / "repository" / "deploy")
    run = subprocess.run([sys.executable, "-m", "build", "--no-isolation", "--skip-dependency-check", "."], cwd=source,
                         env=clean_environment(), capture_output=True, text=True, timeout=200)
    assert run.returncode == 0, run.stdout + run.stderr
    wheel, = (source / "dist").glob("*.whl")
    assert len(list((source / "dist").glob("*.tar.gz"))) == 1 and "none-any" in wheel.name
    zipfile.ZipFile(wheel).extractall(tmp_path / "installed")
    names = {path.name for path in (tmp_path / "installed" / "marble").iterdir()}
    assert {"py.typed", "contract.pb", "__init__.py"} <= names and not any("pb2" in name for name in names)
    assert (HERE.parent.parent / "deploy" / "VERSION").read_text().strip() in wheel.name
    script = "import marble; print(marble.__file__, marble.__version__, marble.solve([[1.0]], [-1.0]).status)"
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, cwd=tmp_path, timeout=60,
                         env=clean_environment(PYTHONPATH=str(tmp_path / "installed"), MARBLE_SERVER=server.address))
    assert str(tmp_path) in run.stdout and "Status.SOLVED" in run.stdout, run.stderr
    assert f" {marble.__version__} " in run.stdout


def _metadata(folder, **environment):
    run = subprocess.run([sys.executable, "setup.py", "-q", "egg_info", "--egg-base", str(folder)], cwd=HERE,
                         env=clean_environment(**environment), capture_output=True, text=True, timeout=100)
    assert run.returncode == 0, run.stderr
    return email.parser.Parser().parsestr((folder / "marble_solver.egg-info" / "PKG-INFO").read_text(encoding="utf-8"))


@pytest.mark.parametrize("address", ["https://example.org/marble", ""])
def test_the_metadata_says_who_and_where_and_its_links_lead_out_of_the_index(address, tmp_path, monkeypatch):
    for name in ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY"):
        monkeypatch.delenv(name, raising=False)
    found = _metadata(tmp_path, **({"MARBLE_REPOSITORY": address} if address else {}))
    readme = (HERE / "README.md").read_text(encoding="utf-8")
    page = found.get_payload()
    assert found["Author"] == "Marble Server maintainers" and "complementarity constraints" in found["Keywords"]
    assert {"plot", "torch", "cvxpy"} <= set(found.get_all("Provides-Extra"))
    classifiers = set(found.get_all("Classifier"))
    assert {"Programming Language :: Python :: 3.10", "Operating System :: POSIX :: Linux"} <= classifiers
    assert re.findall(r"```python.*?```", page, re.DOTALL) == re.findall(r"```python.*?```", readme, re.DOTALL)
    links = re.findall(r"\]\(([^)]+)\)", page)
    own = [link.removeprefix(f"{address}/blob/HEAD/") for link in links if not link.startswith("#")]
    assert "API overview" in page and len(page) > 10000
    if not address:
        assert not own and found.get_all("Project-URL") is None
        return
    assert len(own) > 20 and all((HERE.parent.parent / link.partition("#")[0]).is_file() for link in own)
    assert f"Source, {address}" in found.get_all("Project-URL")


def test_another_package_s_google_rpc_does_not_clash():
    run = _python("-c", "from google.protobuf import descriptor_pb2, descriptor_pool\n"
                  "f = descriptor_pb2.FileDescriptorProto(name='google/rpc/status.proto', package='google.rpc')\n"
                  "f.message_type.add(name='Status')\n"
                  "descriptor_pool.Default().AddSerializedFile(f.SerializeToString())\n"
                  "import marble; print('both')")
    assert run.stdout == "both\n", run.stderr


def test_the_types_hold(tmp_path):
    mypy = shutil.which("mypy")
    if mypy is None:
        pytest.skip("mypy is not installed")
    run = subprocess.run([mypy, "--config-file", "pyproject.toml", "--cache-dir", str(tmp_path)], cwd=HERE,
                         capture_output=True, text=True, timeout=300, env=dict(os.environ, PYTHONPATH=""))
    assert run.returncode == 0, run.stdout


@pytest.mark.parametrize("name", ["client", "errors", "aio", "transport.local_session", "hopper", "model.problem"])
def test_every_module_may_be_the_first_that_is_imported(name):
    code = f"import marble.{name} as one, marble; print(one.__name__, marble.errors.Error is marble.Error)"
    run = _python("-c", code)
    assert run.stdout == f"marble.{name} True\n", run.stderr
    assert not hasattr(marble, "nothing") and {"solve", "aio", "Client"} <= set(dir(marble))


def test_the_package_lists_what_it_offers_and_nothing_else():
    code = ("import inspect, marble; listed = dir(marble); inspect.getmembers(marble)\n"
            "print(*[name for name in listed if not name.startswith('_')])")
    run = _python("-c", code)
    assert run.returncode == 0, run.stderr
    modules = {"aio", "errors", "flights", "hopper", "layers", "lcs", "mat", "nlp"}
    assert set(run.stdout.split()) == modules | set(marble.__all__)


def test_everything_public_is_documented():
    for name in marble.__all__:
        thing = getattr(marble, name)
        assert thing.__doc__, name
        for member, value in vars(thing).items() if isinstance(thing, type) else ():
            if callable(value) and not member.startswith("_"):
                assert value.__doc__, f"{name}.{member}"


def test_casadi_expressions_become_problems_and_back(client):
    casadi = pytest.importorskip("casadi", reason="casadi is not installed (it is not in Debian)")
    from marble.casadi import from_casadi, to_casadi

    for kind in (casadi.SX, casadi.MX):
        x, p = kind.sym("x", 2), kind.sym("p")
        problem = from_casadi(x, (x[0] - 1) ** 2 + (x[1] - 2) ** 2, x[0] + x[1] + 1, ub=2.5, pairs=[(x[0], x[1])])
        answer = client.solve(problem)
        assert abs(answer.z[1] - 1.5) < 1e-6 and answer.row_duals[0] > 0
        for wrong, field in ((lambda: from_casadi(x, x[0] ** 3), "objective"),
                             (lambda: from_casadi(x, p * x[0]), "objective"),
                             (lambda: from_casadi(x, x[0] ** 2, casadi.sin(x[1])), "constraints"),
                             (lambda: from_casadi(x, x[0] ** 2, pairs=[(x[0] * x[1], x[1])]), "pairs[0][0]")):
            with pytest.raises(marble.InvalidProblem) as caught:
                wrong()
            assert caught.value.field == field
    stated = random_problem(2)
    terms = to_casadi(stated)
    pairs = [(terms["G"], terms["H"])]
    again = from_casadi(terms["x"], terms["f"], terms["g"], terms["lbg"], terms["ubg"], pairs=pairs)
    assert abs(client.solve(again).objective - client.solve(stated).objective) < 1e-6
