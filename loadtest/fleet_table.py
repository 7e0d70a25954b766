"""The table of loadtest/fleet."""

import os
import statistics
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests/deploy"))

from fleet import BUILD, Envoy, Fleet, HAProxy, Load, Nginx, NoProxy, example  # noqa: E402

SHARE = 0.1  # of a core for each server, so that one machine has room for three
RUN_S = 15.0


class Throttle:
    """A control group of each server with a share of a core; without the CPU controller there is none."""
    ROOT = Path("/sys/fs/cgroup/cpu")

    def __init__(self):
        self.groups = []

    def __call__(self):  # in the child, before it becomes the server
        group = self.ROOT / f"marble-fleet-{os.getpid()}"
        group.mkdir()
        (group / "cpu.cfs_period_us").write_text("20000")
        (group / "cpu.cfs_quota_us").write_text(str(int(20000 * SHARE)))
        (group / "cgroup.procs").write_text(str(os.getpid()))

    def close(self):
        for group in self.ROOT.glob("marble-fleet-*"):
            group.rmdir()


def rate(target, problem, **keywords):
    load = Load(target, problem, **keywords)
    load.wait_for(10)
    before, began = load.solved, load.clock()
    load.run_for(RUN_S)
    per_s = (load.solved - before) / (load.clock() - began)
    return per_s, load.stop()


def killed(fleet, engine, problem):
    load = Load(engine.target, problem)
    load.wait_for(20)
    fleet.servers[0].kill()
    load.wait_for(40)
    fleet.servers[0].start()
    engine.take_in(fleet.servers[0].name)
    return load.stop()


def restarted(fleet, engine, problem):
    load = Load(engine.target, problem, repeating=isinstance(engine, NoProxy))
    for server in fleet.servers:
        engine.take_out(server.name)
        server.stop()
        load.wait_for(10)
        server.start()
        engine.take_in(server.name)
    return load.stop()


def slow_share(fleet, engine, problem):
    other = Load(fleet.servers[1].address, problem, clients=3)
    before = fleet.answered()
    load = Load(engine.target, problem, clients=9)
    load.run_for(RUN_S)
    load.stop()
    others = other.stop().solved
    shares = [now - then for now, then in zip(fleet.answered(), before)]
    shares[1] -= others
    return shares[1] / statistics.mean([shares[0], shares[2]])


def test_table():
    problem = example()
    throttle = Throttle()
    fleet = Fleet(before=throttle)
    rows = []
    try:
        alone, _ = rate(fleet.servers[0].address, problem, clients=3)
        for kind in (HAProxy, Nginx, Envoy, NoProxy):
            if kind is Envoy and not (BUILD / "envoy/envoy").exists():
                continue
            engine = kind()
            try:
                three, load = rate(engine.target, problem, clients=9)
                after_kill, after_restart = killed(fleet, engine, problem), restarted(fleet, engine, problem)
                rows.append((kind.__name__, f"{alone:.1f}", f"{three:.1f}", f"{three / alone:.2f}", len(load.errors),
                             f"{len(after_kill.errors)} of {after_kill.solved}",
                             f"{len(after_restart.errors)} of {after_restart.solved}", f"{slow_share(fleet, engine, problem):.0%}"))
            finally:
                engine.close()
    finally:
        fleet.close()
        throttle.close()
    print("\n| balance | solves/s of one | of three | ratio | errors | errors, one killed | errors, all restarted | work of a server "
          "with other work |")
    print("|" + " --- |" * 8)
    for row in rows:
        print("| " + " | ".join(map(str, row)) + " |")
