"""Misuse of the C interface. Every function of marble.h is called with one wrong argument at a time: NULL for each pointer,
negative and huge numbers, NaN and infinity, odd texts. A function with a parameter that no table here knows fails the test.

Usage: misuse_test.py BUILD_DIR
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BUILD = pathlib.Path(sys.argv[1]).resolve()
HEADER = ROOT / "client/c/include/marble.h"
LIBRARY = BUILD / "client/c/libmarble.so"
sys.path.insert(0, str(HERE.parent / "page"))
from server import Server  # noqa: E402

# A valid argument for each parameter, by its type and name.
HANDLES = {
    f"{const}marble_{name}*": f"f.{name}"
    for const in ("", "const ")
    for name in ("client", "problem", "options", "call", "session", "solution")
}
MADE = {
    f"marble_{name}**": f"&f.new_{name}" for name in ("client", "problem", "options", "call", "session", "solution")
}
VALID = {
    **HANDLES,
    **MADE,
    "marble_error*": "&f.error",
    "marble_progress_function": "go_on",
    "void* user": "NULL",
    "const double* values": "twos",
    "const double* z": "twos",
    "const int32_t* column_pointers": "two_columns",
    "const int32_t* row_indices": "two_rows",
    "const double** values": "&f.values",
    "const int32_t** indices": "&f.indices",
    "int64_t* count": "&f.count",
    "double* value": "&f.number",
    "const char** state": "&f.state",
    "char* job_id": "f.job_id",
    "const char* job_id": "f.job_id",
    "const char* address": '"local"',
    "const char* path": '"/nowhere.json"',
    "const char* priority": '"batch"',
    "const char* request_id": '"me"',
    "const char* text": '"1"',
    "const char* part": '"g"',
    "const char* vector": '"z"',
    "const char* name": '"z"',
    "int32_t variables": "2",
    "int32_t rows": "2",
    "int32_t columns": "2",
    "int64_t entries": "2",
    "int64_t count": "2",
    "int32_t directions": "1",
    "int32_t losses": "1",
    "int32_t report_columns": "1",
    "int32_t wait": "1",
    "int32_t direction": "0",
    "int32_t loss": "0",
    "int32_t stages": "1",
    "int32_t code": "0",
    "int32_t index": "0",
    "int32_t status": "0",
    "double value": "1",
    "double seconds": "1",
}
VALID_OF = {  # where a function needs another
    ("marble_problem_set_matrix", "part"): '"Q"',
    ("marble_options_set", "name"): '"num_starts"',
    ("marble_options_set_number", "name"): '"num_starts"',
    ("marble_options_get", "name"): '"num_starts"',
    ("marble_solution_number", "name"): '"gap"',
    ("marble_call_set_rows_vector", "name"): '"g"',
    ("marble_solution_weak", "name"): '"pairs"',
    ("marble_solution_conflict", "part"): '"equalities"',
    ("marble_solution_response", "name"): '"values"',
}
NULL_ALLOWED = {
    "error",
    "user",
    ("marble_client_connect", "address"),
    ("marble_client_connect_for_control", "address"),
    ("marble_call_set_progress", "function"),
    ("marble_call_set_warm_start", "start"),
    *(
        (function, parameter)
        for function in (
            "marble_solve",
            "marble_session_open",
            "marble_job_submit",
            "marble_job_state",
            "marble_job_result",
            "marble_job_cancel",
            "marble_job_remove",
        )
        for parameter in ("client", "options", "call")
    ),
}
NULL_FIELD = {("marble_call_set_initial_z", "z"): "initial_z", ("marble_session_set_initial_z", "z"): "initial_z"}
WRONG = {
    "int32_t": ["-1", "INT32_MIN", "0", "3", "INT32_MAX"],
    "int64_t": ["-1", "INT64_MIN", "0", "(int64_t)INT32_MAX + 1", "INT64_MAX"],
    "double": ["-1", "NAN", "INFINITY", "-INFINITY", "1e308", "-1e308"],
    "const char*": ['""', '"%s%n%n"', '"\\xff\\xfe"', '"a\\nb\\x1b[2J"', "long_text"],
}
# A larger count than the array has is read beyond it, which no library can see; a count that no index can be it sees.
# Less than 2^31 variables are a question of memory.
NOT_WRONG = {("int32_t", name, value) for name in ("rows", "columns") for value in ("3", "INT32_MAX")} | {
    ("int32_t", "variables", "INT32_MAX")
}


def functions():
    """Name, return type and parameters (type, name) of each function that the header declares."""
    text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.DOTALL)
    text = re.sub(r"(?m)^#.*|typedef[^;{]*;", "", text)
    for returned, name, parameters in re.findall(r"((?:const )?\w+\*?)\s+(marble_\w+)\(([^)]*)\);", text):
        parameters = re.sub(r"char (\w+)\[\w+\]", r"char* \1", " ".join(parameters.split()))
        yield name, returned, [tuple(one.rsplit(" ", 1)) for one in parameters.split(", ") if one != "void"]


def valid(function, kind, name):
    if (function, name) in VALID_OF:
        return VALID_OF[function, name]
    for key in (f"{kind} {name}", kind):
        if key in VALID:
            return VALID[key]
    raise AssertionError(f"{function}: no valid argument is known for '{kind} {name}': add it to this test's tables")


def is_null_allowed(function, name):
    return name in NULL_ALLOWED or (function, name) in NULL_ALLOWED


def cases():
    """A line of C for each call with one wrong argument; and the functions that were called."""
    for function, returned, parameters in functions():
        arguments = [valid(function, kind, name) for kind, name in parameters]
        used = set(arguments)
        fill = (
            ", ".join(
                part
                for part, place in (
                    ("f.values = twos", "&f.values"),
                    ("f.indices = two_rows", "&f.indices"),
                    ("f.count = 2", "&f.count"),
                    ('f.state = "old"', "&f.state"),
                )
                if place in used
            )
            or "(void)0"
        )
        for at, (kind, name) in enumerate(parameters):
            wrong = [value for value in WRONG.get(kind, []) if (kind, name, value) not in NOT_WRONG]
            if kind.endswith("*") or kind == "marble_progress_function":
                wrong.append("NULL")
            for value in wrong:
                changed = [*arguments[:at], value, *arguments[at + 1 :]]
                # An emptied place cannot be seen through NULL.
                filled = fill if value != "NULL" or not kind.endswith("**") and name != "count" else "(void)0"
                call = f"{function}({', '.join(changed)})"
                label = f"{function}: {name} = {value}".replace("\\", "\\\\").replace('"', "'")
                if ("marble_error*", "error") in parameters:
                    null = value == "NULL" and not is_null_allowed(function, name)
                    field = f'"{NULL_FIELD.get((function, name), name)}"' if null else "NULL"
                    yield f'CASE("{label}", {field}, ({filled}), {call});'
                elif returned.endswith("*"):
                    yield f'PLAIN_CASE("{label}", CHECK({call} != NULL));'
                elif returned == "void":
                    yield f'PLAIN_CASE("{label}", {call});'
                else:
                    yield f'PLAIN_CASE("{label}", (void){call});'


def run(*command, **environment):
    return subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        errors="replace",
        timeout=280,
        env={**os.environ, "MARBLE_SERVER": "local", **environment},
    )


class Misuse(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        lines = list(cases())
        cls.count = len(lines)
        (folder / "misuse_cases.h").write_text("\n".join(lines) + "\n")
        cls.program = folder / "misuse"
        made = run(
            "cc",
            "-std=c11",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-D_GNU_SOURCE",
            "-g",
            "-I",
            HEADER.parent,
            "-I",
            folder,
            HERE / "misuse_test.c",
            "-o",
            cls.program,
            "-L",
            LIBRARY.parent,
            "-lmarble",
            "-lm",
            "-pthread",
            f"-Wl,-rpath,{LIBRARY.parent}",
        )
        assert made.returncode == 0, made.stderr

    def check(self, *command, where, **environment):
        done = run(*command, **environment)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn(f"{where}: {self.count} cases, 0 failures", done.stdout)

    def test_every_function_of_the_header_is_misused(self):
        declared = set(re.findall(r"\b(marble_\w+)\(", re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.DOTALL)))
        self.assertEqual({name for name, _, _ in functions()}, declared)
        self.assertGreater(self.count, 300)

    def test_in_process(self):
        self.check(self.program, where="in process")

    def test_on_a_server(self):
        server = Server(BUILD / "bin")
        self.addCleanup(server.stop)
        self.check(self.program, where=server.address, MARBLE_SERVER=server.address)

    def test_under_valgrind(self):
        if shutil.which("valgrind") is None:
            self.skipTest("valgrind is not installed")
        self.check(
            "valgrind",
            "--quiet",
            "--error-exitcode=9",
            "--leak-check=full",
            "--errors-for-leak-kinds=definite",
            self.program,
            where="in process",
        )


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
