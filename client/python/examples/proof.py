"""A proof as a job: submitted, watched while incumbent and bound close in on each other, ended once that is enough.

Usage: MARBLE_SERVER=127.0.0.1:50051 python examples/proof.py [GAP]    relative; default 0.01
"""

import sys

import marble
from marble.hopper import Hopper

enough = float(sys.argv[1]) if len(sys.argv) > 1 else 0.01

with marble.Client() as client:
    job = client.jobs.submit(Hopper(steps=10).problem(), options={"global_search": True, "time_limit_s": 60})
    print(f"{'nodes':>7} {'open':>6} {'incumbent':>12} {'bound':>12} {'gap':>8}")
    ended = False
    for event in client.jobs.watch(job.job_id, progress_interval=0.2):
        seen = event.job
        if seen.nodes:
            print(f"{seen.nodes:>7} {seen.open_nodes:>6} {seen.incumbent:>12.6f} {seen.bound:>12.6f} {seen.gap:>8.1e}")
        if seen.gap <= enough and not ended:
            client.jobs.cancel(job.job_id)  # the answer keeps its incumbent and its bound
            ended = True
    answer = client.jobs.result(job.job_id)
    print(f"{answer.status.value}: objective {answer.objective:.6f}, at most {answer.objective - answer.bound:.1e} "
          f"above the optimum; {'proved' if answer.proved else 'not proved'} "
          f"to {answer.options['relative_gap_tolerance']:g}")
