"""The same problem by another client and by `marble`, which is the C++ client: z, multipliers and objective have the same bits.

Usage: same_bits.py BUILD_DIR python|typescript|grpcurl [GRPCURL]    the script same_bits knows the rest
"""

import json
import pathlib
import struct
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
BUILD = pathlib.Path(sys.argv[1]).resolve()
CLIENT = sys.argv[2]
GRPCURL = sys.argv[-1]
sys.path.insert(0, str(HERE.parent / "page"))
from server import Server  # noqa: E402

PARTS = ("z", "y", "nu", "xi", "eta")


def bits(numbers):
    return struct.pack(f"<{len(numbers)}d", *numbers).hex()


def by_cli(server, path):
    answer = json.loads(server.run("solve", "--quiet", "--output", "json", path))
    pairs = answer["complementarity_multipliers"]
    return [answer["z"], answer["equality_multipliers"], answer["inequality_multipliers"], pairs["L"], pairs["R"],
            [answer["objective"]]]


def by_python(server, path):
    import marble

    with marble.Client(server.address) as client:
        answer = client.solve(marble.Problem.load(path))
    return [*(getattr(answer, part).tolist() for part in PARTS), [answer.objective]]


def by_typescript(server, path):
    run = subprocess.run(["node", HERE / "solve.mjs", BUILD / "typescript/client/ts/dist/index.js", server.address, path],
                         capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def by_grpcurl(server, path):
    problem = json.loads(path.read_text())
    names = {"Q": "hessian", "A": "equality_matrix", "C": "inequality_matrix", "L": "left_matrix", "R": "right_matrix",
             "g": "gradient", "b": "equality_offset", "d": "inequality_offset", "l": "left_offset", "r": "right_offset",
             "c0": "constant"}
    message = {name: columns(problem[key]) if key in "QACLR" else problem[key] for key, name in names.items()
               if problem.get(key)}
    run = subprocess.run([GRPCURL, "-plaintext", "-protoset", BUILD / "marble.binpb", "-d", "@", server.address,
                          "marble.v1.Solver/Solve"], input=json.dumps({"problem": message}), capture_output=True,
                         text=True, timeout=120)
    assert run.returncode == 0, run.stderr
    answer = json.loads(run.stdout, parse_int=float)["solution"]  # "-0" too
    parts = ("z", "equalityMultipliers", "inequalityMultipliers", "complementarityMultipliersL",
             "complementarityMultipliersR")
    return [*(answer.get(part, []) for part in parts), [answer["objective"]]]


def columns(triplets):
    """The message SparseMatrix of a file's triplets, none of them twice."""
    entries = sorted(zip(triplets["j"], triplets["i"], triplets["v"]))
    counts = [0] * (triplets["cols"] + 1)
    for column, _, _ in entries:
        counts[column + 1] += 1
    pointers = [sum(counts[:column + 1]) for column in range(len(counts))]
    return {"rows": triplets["rows"], "columns": triplets["cols"], "column_pointers": pointers,
            "row_indices": [row for _, row, _ in entries], "values": [value for _, _, value in entries]}


CALLS = {"python": by_python, "typescript": by_typescript, "grpcurl": by_grpcurl}


class SameBits(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = Server(BUILD / "bin")
        cls.addClassCleanup(cls.server.stop)

    def check(self, path):
        reference = by_cli(self.server, path)
        self.assertGreater(len(reference[0]), 0)
        answer = CALLS[CLIENT](self.server, path)
        for part, ours, theirs in zip((*PARTS, "objective"), answer, reference, strict=True):
            self.assertEqual(bits(ours), bits(theirs), part)

    def test_a_tiny_problem(self):
        self.check(self.server.tiny())

    def test_a_rocket(self):
        self.check(self.server.example("rocket"))

    def test_a_hopper(self):
        self.check(self.server.example("hopper"))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
