"""With an installed wheel alone: a solve and a session in process and on a server that it starts have the same bits."""

import pathlib
import subprocess
import sys
import tempfile
import time

import marble
from marble.hopper import Hopper

PARTS = ("z", "y", "nu", "xi", "eta")
problem = Hopper(steps=10).problem()
here = marble.solve(problem)
assert here.status is marble.Status.SOLVED and not here.job_id, here
with tempfile.TemporaryDirectory() as folder:
    address = pathlib.Path(folder) / "address"
    server = subprocess.Popen([sys.executable, "-m", "marble", "server", "--listen", f"unix:{folder}/socket", "--http", "none",
                               "--log-level", "error", "--address-file", address])
    try:
        while not (address.exists() and address.read_text().endswith("\n")):
            assert server.poll() is None, "the server ended at once"
            time.sleep(0.01)
        with marble.Client(address.read_text().split()[0]) as remote, marble.Client("local") as local:
            pairs = [(here, remote.solve(problem))]
            with local.session(problem) as one, remote.session(problem) as other:
                pairs += [(one.update(g=problem.g * f), other.update(g=problem.g * f)) for f in (1.0, 1.01, 1.02)]
        for ours, theirs in pairs:
            assert theirs.job_id and ours.iterations == theirs.iterations
            assert all(getattr(ours, part).tobytes() == getattr(theirs, part).tobytes() for part in PARTS)
    finally:
        server.terminate()
        server.wait()
print("the same bits")
