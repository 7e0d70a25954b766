"""Many sessions in one process: how long they take to open, threads, memory, and updates of a tiny problem.

Usage: sessions.py ADDRESS SESSIONS [UPDATES]; the server needs --sessions and --client-sessions.
"""

from __future__ import annotations

import itertools
import pathlib
import sys
import time

import numpy as np

import marble


def status(name: str) -> int:
    """A number of /proc/self/status."""
    lines = pathlib.Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(name + ":")).split()[1])


def times(call, count: int) -> str:
    """Median and 99 % quantile of calls, µs."""
    took = []
    for k in range(count):
        begin = time.perf_counter()
        call(k)
        took.append(1e6 * (time.perf_counter() - begin))
    return f"{np.median(took):.0f} µs, {np.quantile(took, 0.99):.0f} µs"


def main() -> None:
    address, count, updates = sys.argv[1], int(sys.argv[2]), int((sys.argv[3:] or ["3000"])[0])
    problem = marble.LCQP(2 * np.eye(2), [-2, -2], L=[1, 0], R=[0, 1], name="tiny")
    numbers = [np.array([-2.0, -2.0]), np.array([-2.0, -2.01])]
    with marble.Client(address) as client:
        client.session(problem).update()
        threads, memory, begin = status("Threads"), status("VmRSS"), time.perf_counter()
        sessions = [client.session(problem) for _ in range(count)]
        opened = time.perf_counter() - begin
        print(f"{count} sessions: opened in {opened:.1f} s, {status('Threads') - threads} threads more, "
              f"{(status('VmRSS') - memory) / count:.0f} kB each")
        turn = itertools.cycle(sessions)
        print("  first session:", times(lambda k: sessions[0].update(g=numbers[k % 2]), updates))
        print("  last session: ", times(lambda k: sessions[-1].update(g=numbers[k % 2]), updates))
        print("  in turns:     ", times(lambda k: next(turn).update(g=numbers[k % 2]), max(updates, count)))
        print("  solve:        ", times(lambda k: client.solve(problem), updates // 4))
        print("  info:         ", times(lambda k: client.info(), updates // 4))


if __name__ == "__main__":
    main()
