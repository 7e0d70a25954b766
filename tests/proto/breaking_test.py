"""The contract as it is breaks nobody, and breaking.py sees what would.

Usage: breaking_test.py ROOT MARBLE_BINPB [unittest's arguments]
"""

import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
from breaking import breaking, read  # noqa: E402

ROOT = pathlib.Path(sys.argv[1])
BUILT = pathlib.Path(sys.argv[2])
RELEASED = ROOT / "proto" / "released" / "marble-v1.binpb"

# What is done to a file: its text, what comes in its place, and what is said of it ("" where nothing is).
BREAKING = {
    "a field's number changes": (
        "solution", "double objective = 9;", "double objective = 90;",
        "marble.v1.Solution.objective = 9 is gone, and its number is not reserved"),
    "a field's type changes": (
        "progress", "double elapsed_s = 11;", "float elapsed_s = 11;",
        "marble.v1.Progress.elapsed_s = 11: type was double, is float"),
    "a field's type changes to another of the same bytes": (
        "job", "int64 iterations = 17;", "uint64 iterations = 17;", "type was int64, is uint64"),
    "a field's message changes": (
        "service", "InitialPoint initial_point = 3;", "Problem initial_point = 3;",
        "type was message .marble.v1.InitialPoint, is message .marble.v1.Problem"),
    "a field becomes repeated": (
        "job", "string job_id = 1;\n  // The call that", "repeated string job_id = 1;\n  // The call that",
        "marble.v1.JobInfo.job_id = 1: label was optional, is repeated"),
    "an optional field can no longer be absent": (
        "options", "optional bool polish = 17;", "bool polish = 17;", "presence was optional, is not there"),
    "a field is renamed, and with it its JSON": (
        "problem", "repeated double gradient = 4", "repeated double linear_term = 4",
        "marble.v1.Problem.gradient = 4: name was gradient, is linear_term"),
    "a field's JSON alone is renamed": (
        "problem", "double constant = 5;", 'double constant = 5 [json_name = "c0"];', "JSON name was constant, is c0"),
    "two fields change places": (
        "problem", "left_offset = 11", "right_offset = 11", "name was left_offset, is right_offset",
        "right_offset = 13", "left_offset = 13"),
    "numbers in a row are not packed any more": (
        "problem", "repeated double z = 1 [packed = true];", "repeated double z = 1 [packed = false];",
        "packing was not there, is off"),
    "a field goes into a oneof": (
        "service", "  // The server's id of the job, as in its log.\n  string job_id = 1;",
        "  oneof id {\n    string job_id = 1;\n  }", "oneof was not there, is id"),
    "a field leaves its oneof": (
        "service", "    google.rpc.Status error = 3;\n  }", "  }\n  google.rpc.Status error = 3;",
        "oneof was outcome, is not there"),
    "a field goes unreserved": (
        "solution", "  double kkt_residual = 11;", "", "kkt_residual = 11 is gone, and its number is not reserved"),
    "a field goes with its number reserved but not its name": (
        "solution", "  double kkt_residual = 11;", "  reserved 11;", "is gone, and its name is not reserved"),
    "an enum's value changes its number": (
        "solution", "STATUS_UNBOUNDED = 8;", "STATUS_UNBOUNDED = 80;",
        "marble.v1.Status.STATUS_UNBOUNDED = 8 is gone, and its number is not reserved"),
    "an enum's value is renamed": (
        "solution", "STATUS_CANCELLED = 5;", "STATUS_STOPPED = 5;",
        "marble.v1.Status.STATUS_CANCELLED = 5: is now STATUS_STOPPED"),
    "an enum's value goes unreserved": (
        "job", "  PRIORITY_BATCH = 3;", "", "PRIORITY_BATCH = 3 is gone, and its number is not reserved"),
    "a nested enum's value is renamed": (
        "options", "TYPE_REAL = 1;", "TYPE_FLOATING = 1;",
        "marble.v1.OptionSchema.Type.TYPE_REAL = 1: is now TYPE_FLOATING"),
    "an enum goes": (
        "problem", "  HessianForm hessian_form = 3;", "  int32 hessian_form = 3;", "enum marble.v1.HessianForm is gone",
        "enum HessianForm {", "enum Symmetry {"),
    "a message is renamed": (
        "service", "SolveBatchRequest", "ManyRequest", "message marble.v1.SolveBatchRequest is gone"),
    "a service is renamed": (
        "service", "service Jobs {", "service JobService {", "service marble.v1.Jobs is gone"),
    "an rpc goes": (
        "service", "  rpc Get(GetJobRequest) returns (GetJobResponse);", "", "marble.v1.Jobs.Get is gone"),
    "an rpc is renamed": (
        "service", "rpc GetInfo(", "rpc Info(", "marble.v1.Server.GetInfo is gone"),
    "an rpc takes another message": (
        "service", "rpc Submit(SolveRequest)", "rpc Submit(SolveStreamRequest)",
        "marble.v1.Jobs.Submit: request was .marble.v1.SolveRequest, is .marble.v1.SolveStreamRequest"),
    "an rpc streams its answers": (
        "service", "returns (SolveResponse);\n  // Solve with", "returns (stream SolveResponse);\n  // Solve with",
        "marble.v1.Solver.Solve: response was .marble.v1.SolveResponse, is stream .marble.v1.SolveResponse"),
    "an rpc does not stream its requests any more": (
        "service", "rpc Session(stream SessionRequest)", "rpc Session(SessionRequest)",
        "request was stream .marble.v1.SessionRequest, is .marble.v1.SessionRequest"),
}
COMPATIBLE = {
    "a new field": ("solution", "double objective = 9;", "double objective = 9;\n  double spread = 99;"),
    "a new optional field": ("options", "optional int32 num_starts = 19;",
                             "optional int32 num_starts = 19;\n  optional bool verbose = 99;"),
    "a new value of an enum": ("job", "PRIORITY_BATCH = 3;", "PRIORITY_BATCH = 3;\n  PRIORITY_IDLE = 4;"),
    "a new member of a oneof": ("service", "    Queued queued = 5;", "    Queued queued = 5;\n    Limits limits = 60;"),
    "a new message, enum, rpc and service": (
        "service", "service Server {", "message New {\n  enum Kind {\n    KIND_UNSPECIFIED = 0;\n  }\n}\n"
        "service Newer {\n  rpc Do(New) returns (New);\n}\nservice Server {\n  rpc Do(New) returns (stream New);"),
    "other words in a comment": ("problem", "// g, n entries; its size", "// The gradient; its size"),
    "a field that goes with number and name reserved": (
        "solution", "  double kkt_residual = 11;", '  reserved 11;\n  reserved "kkt_residual";'),
    "an enum's value that goes with number and name reserved": (
        "job", "  PRIORITY_BATCH = 3;", '  reserved 3;\n  reserved "PRIORITY_BATCH";'),
    "packing that proto3 has anyway": (
        "problem", "repeated double z = 1 [packed = true];", "repeated double z = 1;"),
    "fields in another order": (
        "problem", "  // c0, added to the objective.\n  double constant = 5;\n", "",
        "  // g, n entries; its size", "  double constant = 5;\n  // g, n entries; its size"),
}


class Contract(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        shutil.copytree(ROOT / "proto", self.folder / "proto")

    def mutate(self, file, *replacements):
        path = self.folder / "proto" / "marble" / "v1" / f"{file}.proto"
        text = path.read_text(encoding="utf-8")
        for old, new in zip(replacements[::2], replacements[1::2]):
            self.assertIn(old, text)
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")

    def compile(self):
        made = self.folder / "marble.binpb"
        files = sorted((self.folder / "proto").rglob("*.proto"))
        subprocess.run(["protoc", "-I", self.folder / "proto", "--include_imports", f"--descriptor_set_out={made}",
                        *files], check=True)
        return read(made)

    def test_nothing_that_was_released_is_broken_now(self):
        self.assertEqual(breaking(read(RELEASED), read(BUILT)), [])

    def test_the_built_descriptor_set_is_whole(self):
        names = {file.name for file in read(BUILT).file}
        for file in (ROOT / "proto").rglob("*.proto"):
            self.assertIn(str(file.relative_to(ROOT / "proto")), names)
        for file in read(BUILT).file:
            self.assertLessEqual(set(file.dependency), names)
            self.assertTrue(file.source_code_info.location, "no comments, which grpcurl describe shows")

    def test_a_file_that_moves_is_reported(self):
        folder = self.folder / "proto" / "marble" / "v1"
        (folder / "problem.proto").rename(folder / "lcqp.proto")
        for file in folder.glob("*.proto"):
            file.write_text(file.read_text().replace("marble/v1/problem.proto", "marble/v1/lcqp.proto"))
        changes = breaking(read(RELEASED), self.compile())
        self.assertIn("message marble.v1.Problem has moved from marble/v1/problem.proto to marble/v1/lcqp.proto", changes)

    def test_a_package_that_changes_is_reported(self):
        for file in (self.folder / "proto" / "marble" / "v1").glob("*.proto"):
            file.write_text(file.read_text().replace("package marble.v1;", "package marble.v2;"))
        self.assertIn("marble/v1/job.proto: package was marble.v1, is marble.v2",
                      breaking(read(RELEASED), self.compile()))

    def test_what_is_reserved_stays_reserved(self):
        self.mutate("solution", "double kkt_residual = 11;", 'reserved 11, 50 to 60;\n  reserved "kkt_residual";')
        released = self.compile()
        self.mutate("solution", 'reserved 11, 50 to 60;\n  reserved "kkt_residual";', "reserved 50 to 60;\n  bool fine = 11;")
        self.assertEqual(breaking(released, self.compile()), [
            "marble.v1.Solution: reserved 11 to 11 is not reserved any more",
            'marble.v1.Solution: reserved "kkt_residual" is not reserved any more'])

    def test_generated_code_s_names_stay(self):
        self.mutate("problem", "package marble.v1;", 'package marble.v1;\noption go_package = "marble/one";')
        released = self.compile()
        self.assertEqual(breaking(read(RELEASED), released), [])
        self.mutate("problem", "marble/one", "marble/two")
        self.assertEqual(breaking(released, self.compile()),
                         ["marble/v1/problem.proto: go_package was marble/one, is marble/two"])


def promise(words):
    return "test_" + "".join(c if c.isalnum() else "_" for c in words)


def add(name, file, old, new, said, *more):
    def reported(self):
        self.mutate(file, old, new, *more)
        changes = breaking(read(RELEASED), self.compile())
        if said:
            self.assertTrue(any(said in change for change in changes), changes)
        else:
            self.assertEqual(changes, [])

    setattr(Contract, promise(name), reported)


for words, (file, old, new, said, *more) in BREAKING.items():
    add(f"reported if {words}", file, old, new, said, *more)
for words, (file, old, new, *more) in COMPATIBLE.items():
    add(f"compatible {words}", file, old, new, "", *more)

if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
