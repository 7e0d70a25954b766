"""The hopper in closed loop: a session follows each plan's first step, and starts the next plan from the last.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/mpc.py [TICKS]
"""

import sys
import time

import marble
from marble.hopper import Hopper

ticks = int(sys.argv[1]) if len(sys.argv) > 1 else 20
hopper = Hopper(steps=40)

with marble.Client() as client, client.session(hopper.problem()) as session:
    print(f"{'tick':>4} {'status':<15} {'factorizations':>14} {'round trip ms':>13} {'body x':>7}")
    plan = session.update()
    for tick in range(ticks):
        hopper = hopper.advanced(plan.z)
        begin = time.perf_counter()
        plan = session.update(hopper.problem(), shift=hopper.steps)
        elapsed_ms = 1e3 * (time.perf_counter() - begin)
        print(f"{tick:>4} {plan.status.value:<15} {plan.factorizations:>14} {elapsed_ms:>13.2f} "
              f"{hopper.position[0]:>7.3f}")
