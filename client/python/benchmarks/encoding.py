"""How long a problem takes to the wire and an answer from it, beside protobuf's own way of it. Needs no server.

Usage: python benchmarks/encoding.py
"""

import time

import numpy as np
import scipy.sparse as sp

import marble
from marble.base import contract
from marble.message import requests, wire
from marble.message.requests import Call


def best_ms(work, repeats=9):
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - begin))
    return min(times)


def sized(megabytes):
    random = np.random.default_rng(0)
    n = int(megabytes * 1e6 / 62)
    rows, columns = np.arange(n // 2).repeat(4), random.integers(0, n, size=n // 2 * 4)
    A = sp.csc_matrix((random.normal(size=rows.size), (rows, columns)), shape=(n // 2, n))
    return marble.LCQP(sp.identity(n), random.normal(size=n), A=A, b=np.zeros(n // 2), C=sp.identity(n), d=np.ones(n))


def by_protobuf(problem):
    message = contract.message("Problem")(gradient=problem.g.tolist(), equality_offset=problem.b.tolist(),
                                          inequality_offset=problem.d.tolist())
    for letter, field in (("Q", "hessian"), ("A", "equality_matrix"), ("C", "inequality_matrix")):
        values, part = getattr(problem, letter), getattr(message, field)
        part.rows, part.columns = values.shape
        part.column_pointers.extend(values.indptr.tolist())
        part.row_indices.extend(values.indices.tolist())
        part.values.extend(values.data.tolist())
    return message.SerializeToString()


def answer(n):
    response = contract.message("SolveResponse")()
    response.solution.z.extend(np.random.default_rng(0).normal(size=n).tolist())
    return response.SerializeToString()


titles = ("request MB", "encode ms", "protobuf ms", "answer MB", "decode ms", "protobuf ms")
print(" ".join(f"{title:>12}" for title in titles))
for size in (0.1, 1.0, 10.0):
    problem = sized(size)
    data, response = requests.solve(problem, Call()), answer(int(size * 1e6 / 8))
    message = contract.message("SolveResponse")
    print(f"{len(data) / 1e6:>12.2f} {best_ms(lambda: requests.solve(problem, Call())):>12.3g} "
          f"{best_ms(lambda: by_protobuf(problem)):>12.3g} {len(response) / 1e6:>12.2f} "
          f"{best_ms(lambda: wire.decode('SolveResponse', response)):>12.3g} "
          f"{best_ms(lambda: np.array(message.FromString(response).solution.z)):>12.3g}")
