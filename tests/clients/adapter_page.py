"""The examples of client/python/ADAPTERS.md, and problems that the tests share."""

import contextlib
import dataclasses
import io
import pathlib
import re
import sys
import warnings
from unittest import mock

import numpy as np

import marble

ROOT = pathlib.Path(__file__).resolve().parents[2]


def example(tool):
    """What a section's examples print, and what the page says that they print."""
    page = ROOT / "client/python/ADAPTERS.md"
    section, = re.findall(rf"^## {tool}\n(.*?)(?=^## |\Z)", page.read_text(), re.DOTALL | re.MULTILINE)
    examples = re.findall(r"```python\n(.*?)```\n```text\n(.*?)```", section, re.DOTALL)
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        for code, _ in examples:
            exec(compile(code, f"{page}: {tool}", "exec"), {})
    return out.getvalue(), "".join(said for _, said in examples)


@contextlib.contextmanager
def one_warning_of_almost(test):
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        yield
    warned = [one for one in seen if one.category is marble.AlmostSolved]
    test.assertEqual(len(warned), 1, [str(one.message) for one in seen])
    test.assertIn("almost solved: ", str(warned[0].message))


@contextlib.contextmanager
def almost_solved(test, owner, name):
    """What `owner.name` returns is within the reduced tolerances alone, and the test's adapter must say so once."""
    real = getattr(owner, name)

    def almost(*arguments, **words):
        return dataclasses.replace(real(*arguments, **words), status=marble.Status.ALMOST_SOLVED)

    with mock.patch.object(owner, name, almost), one_warning_of_almost(test):
        yield


def random_qp(seed, n=12, rows=8, equalities=3):
    random = np.random.default_rng(seed)
    root, inside = random.normal(size=(n, n)), random.normal(size=n)
    G, A = random.normal(size=(rows, n)), random.normal(size=(equalities, n))
    return root @ root.T + np.eye(n), random.normal(size=n), G, G @ inside + 0.1 * random.random(rows), A, A @ inside


@contextlib.contextmanager
def local_and_remote(folder):
    """A client without a server, and one of a server, where there is a program for it."""
    sys.path.insert(0, str(ROOT / "client/python/tests"))
    from support import SERVER, Server

    with marble.Client("local") as here:
        if not pathlib.Path(SERVER).is_file():
            yield [here]
            return
        server = Server(folder)
        try:
            with marble.Client(server.address) as there:
                yield [here, there]
        finally:
            server.kill()
