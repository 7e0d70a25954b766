"""The C interface: a real C program in process, on a server and under valgrind; its symbols and layouts against the kept
list; the example of its page.

Usage: c_test.py BUILD_DIR    with --write the list is written anew: raise MARBLE_ABI_VERSION where a line went or changed
"""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BUILD = pathlib.Path(sys.argv[1]).resolve()
KEPT = HERE / "abi.txt"
HEADER = ROOT / "client/c/include/marble.h"
LIBRARY = BUILD / "client/c/libmarble.so"
STRICT = ["-std=c11", "-Wall", "-Wextra", "-pedantic", "-Werror", "-D_GNU_SOURCE"]
sys.path.insert(0, str(HERE.parent / "page"))
from server import Server  # noqa: E402


def run(*command, **environment):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=240,
                          env={**os.environ, "MARBLE_SERVER": "local", **environment})


def compiled(source, folder):
    program = pathlib.Path(folder) / "program"
    made = run("cc", *STRICT, "-g", "-I", HEADER.parent, source, "-o", program, "-L", LIBRARY.parent, "-lmarble", "-lm",
               "-pthread", f"-Wl,-rpath,{LIBRARY.parent}")
    assert made.returncode == 0, made.stderr
    return program


def interface(folder):
    """What a compiled program relies on, a line each: soname, symbols, prototypes, layouts, codes."""
    soname = re.search(r"SONAME\s+(\S+)", run("objdump", "-p", LIBRARY).stdout)[1]
    symbols = sorted(line.split()[-1] for line in run("nm", "-D", "--defined-only", LIBRARY).stdout.splitlines())
    text = re.sub(r"/\*.*?\*/", "", HEADER.read_text(), flags=re.DOTALL)
    text = re.sub(r"(?m)^#.*", "", text)
    prototypes = sorted(" ".join(found.split()).replace("( ", "(") for found in
                        re.findall(r"(?:int32_t|void|double|const char\*|typedef int) \(?\*?marble_[^;{]*\)", text))
    source = ["#include <marble.h>", "#include <stddef.h>", "#include <stdio.h>", "int main(void) {"]
    for name, body in re.findall(r"typedef struct (\w+) \{(.*?)\}", text, re.DOTALL):
        source.append(f'printf("{name} %zu\\n", sizeof({name}));')
        for member in re.findall(r"(\w+)(?:\[\d+\])?;", body):
            source.append(f'printf("{name}.{member} %zu %zu\\n", offsetof({name}, {member}), '
                          f'sizeof((({name}*)0)->{member}));')
    for name in re.findall(r"\b(MARBLE_\w+) = ", text):
        source.append(f'printf("{name} %d\\n", {name});')
    (pathlib.Path(folder) / "layout.c").write_text("\n".join([*source, "return 0; }\n"]))
    layout = run(compiled(pathlib.Path(folder) / "layout.c", folder)).stdout.splitlines()
    return [soname, *symbols, *prototypes, *layout]


class CInterface(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = cls.enterClassContext(tempfile.TemporaryDirectory())
        cls.program = compiled(HERE / "c_test.c", cls.folder)
        cls.server = Server(BUILD / "bin")
        cls.addClassCleanup(cls.server.stop)

    def check_program(self, *command, where, **environment):
        done = run(*command, **environment)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn(f"{where}: 0 failures", done.stdout)

    def test_its_promises_in_process(self):
        self.check_program(self.program, where="in process")

    def test_its_promises_on_a_server(self):
        self.check_program(self.program, where=self.server.address, MARBLE_SERVER=self.server.address)

    def test_nothing_leaks_and_nothing_is_read_that_is_not_there(self):
        if shutil.which("valgrind") is None:
            self.skipTest("valgrind is not installed")
        self.check_program("valgrind", "--quiet", "--error-exitcode=9", "--leak-check=full",
                           "--errors-for-leak-kinds=definite", self.program, where="in process")

    def test_same_bits_as_the_program_marble_here_and_there(self):
        for path in (self.server.tiny(), self.server.example("hopper")):
            answer = json.loads(run(BUILD / "bin/marble", "solve", "--quiet", "--output", "json", path).stdout)
            expected = [answer["objective"], *answer["z"]]
            for address in ("local", self.server.address):
                reported = run(self.program, path, MARBLE_SERVER=address).stdout.split()
                self.assertEqual([float.fromhex(number).hex() for number in reported], [float(x).hex() for x in expected])

    def test_a_server_that_hangs_is_waited_for_until_the_deadline(self):
        server = Server(BUILD / "bin")
        self.addCleanup(server.stop)
        with subprocess.Popen([self.program, "--hung"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                              env={**os.environ, "MARBLE_SERVER": server.address}) as program:
            for line, number in (("stop\n", signal.SIGSTOP), ("go on\n", signal.SIGCONT)):
                self.assertEqual(program.stdout.readline(), line)
                server.process.send_signal(number)
                if number == signal.SIGSTOP:
                    os.waitid(os.P_PID, server.process.pid, os.WSTOPPED | os.WNOWAIT)
                program.stdin.write("\n")
                program.stdin.flush()
            self.assertEqual(program.wait(60), 0)

    def test_a_named_server_that_is_away_is_an_error_and_no_local_solve(self):
        done = run(self.program, self.server.tiny(), MARBLE_SERVER="127.0.0.1:1")
        self.assertEqual(done.returncode, 1)
        self.assertIn("127.0.0.1:1", done.stderr)

    def test_the_abi_is_the_kept_one_and_exports_nothing_else(self):
        lines = interface(self.folder)
        self.assertEqual(lines, KEPT.read_text().splitlines(), "see --write in this test's usage")
        for symbol in run("nm", "-D", "--defined-only", LIBRARY).stdout.splitlines():
            self.assertTrue(symbol.split()[-1].startswith("marble_"), symbol)

    def test_the_example_of_its_page(self):
        page = (ROOT / "client/c/README.md").read_text()
        source = pathlib.Path(self.folder) / "first.c"
        source.write_text(re.search(r"```c\n(.*?)```", page, re.DOTALL)[1])
        done = run(compiled(source, self.folder))
        self.assertEqual(done.stdout, re.search(r"```text\n(.*?)```", page, re.DOTALL)[1])


if __name__ == "__main__":
    if "--write" in sys.argv:
        with tempfile.TemporaryDirectory() as folder:
            KEPT.write_text("\n".join(interface(folder)) + "\n")
    else:
        unittest.main(argv=sys.argv[:1])
