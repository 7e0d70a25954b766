"""A wheel of marble-solver, made from the build that is there: what is in it, and what it does in an environment of its own.

Usage: wheel_test.py BUILD_DIR    exit code 77 where pip has no index
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile

sys.dont_write_bytecode = True
import elf

ROOT = pathlib.Path(__file__).resolve().parents[2]
BUILD = pathlib.Path(sys.argv[1]).resolve()
PYTHON = "/usr/bin/python3"
ANSWERS = pathlib.Path(__file__).with_name("wheel_answers.py")
# Of the system by every manylinux policy.
SYSTEM = r"(linux-vdso|ld-linux-x86-64|lib(c|m|dl|rt|pthread|resolv|gcc_s|stdc\+\+|z))\.so"


def run(*command, **keywords):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, **keywords)
    assert done.returncode == 0, f"{command}: {done.stdout[-4000:]}{done.stderr[-4000:]}"
    return done.stdout


class Wheel(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.wheel, = (BUILD / "wheels").glob("*.whl")
        work = tempfile.TemporaryDirectory(prefix="marble wheel ")
        cls.addClassCleanup(work.cleanup)
        cls.venv = pathlib.Path(work.name) / "venv"
        run(PYTHON, "-m", "venv", "--without-pip", cls.venv)
        run(PYTHON, "-m", "pip", "--python", cls.venv / "bin/python", "install", "--quiet", cls.wheel)
        cls.clean = {"PATH": f"{cls.venv / 'bin'}:/usr/bin:/bin", "HOME": work.name}
        cls.installed, = cls.venv.glob("lib/python3.*/site-packages")

    def test_its_tag_is_the_glibc_s_it_was_built_with_and_it_is_not_large(self):
        glibc = run("getconf", "GNU_LIBC_VERSION").split()[1].replace(".", "_")
        self.assertTrue(self.wheel.name.endswith(f"-manylinux_{glibc}_x86_64.whl"), self.wheel.name)
        self.assertLessEqual(self.wheel.stat().st_size, 26e6)

    def test_what_it_links_is_inside_or_of_every_system(self):
        binaries = [*self.installed.glob("marble/_core*.so"), *self.installed.glob("marble/bin/*")]
        self.assertEqual(len(binaries), 3)
        for binary in binaries:
            for name, path in re.findall(r"^\s*(\S+)(?: => (.*?))? ?(?:\(0x|$)", run("ldd", binary), re.MULTILINE):
                name = pathlib.Path(name).name
                self.assertTrue(str(self.installed) in path or re.match(SYSTEM, name), f"{binary}: {name} => {path}")

    def test_no_library_is_searched_in_the_current_directory(self):
        files = [*elf.linked_files(self.installed / "marble"), *elf.linked_files(self.installed / "marble_solver.libs")]
        self.assertGreater(len(files), 5)
        self.assertEqual([], [fault for file in files for fault in elf.search_path_faults(file)])

    def test_its_extension_and_programs_are_hardened(self):
        if shutil.which("hardening-check") is None:
            self.skipTest("hardening-check (devscripts) is not installed")
        self.assertEqual([], elf.hardening_faults(*elf.linked_files(self.installed / "marble")))

    def test_the_licence_of_everything_inside_is_reported(self):
        folder, = self.installed.glob("marble_solver-*.dist-info/licenses")
        reported = (folder / "INSIDE").read_text()
        for library in self.installed.glob("marble_solver.libs/*"):
            name = re.sub(r"-[0-9a-f]{8}(\.so.*)", r"\1", library.name)
            self.assertIn(name.partition(".so")[0], reported)
        for line in reported.split("\n\n")[1].splitlines():
            self.assertGreater((folder / line.partition(":")[0]).stat().st_size, 0, line)
        for text in folder.glob("*.copyright"):
            for name in re.findall(r"/usr/share/common-licenses/([\w.+-]*\w)", text.read_text()):
                self.assertTrue((folder / name).is_file() or not pathlib.Path("/usr/share/common-licenses", name).exists(), name)
                self.assertRegex(reported, rf"(?m)^{re.escape(name)}: .*{re.escape(text.name)}")
        metadata = (folder.parent / "METADATA").read_text()
        self.assertEqual({line.partition(": ")[2] for line in metadata.splitlines() if line.startswith("License-File")},
                         {file.name for file in folder.iterdir()})

    def test_it_solves_in_process_and_on_its_own_server_to_the_same_bits(self):
        reported = run("python", ANSWERS, env=self.clean, cwd=self.clean["HOME"])
        self.assertIn("the same bits", reported)

    def test_its_programs_run(self):
        version = (ROOT / "deploy/VERSION").read_text().strip()
        for program in ("marble-server", "marble"):
            self.assertEqual(run(program, "--version", env=self.clean).split(), [program, version])
        work = pathlib.Path(self.clean["HOME"])
        (work / "hopper.json").write_text(run("marble", "example", "hopper", "--steps", "5", env=self.clean))
        self.assertIn("solved", run("marble", "solve", "--local", "--quiet", "hopper.json", env=self.clean, cwd=work))

    def test_a_pure_package_is_nowhere_in_it(self):
        names = zipfile.ZipFile(self.wheel).namelist()
        self.assertIn("Root-Is-Purelib: false", zipfile.ZipFile(self.wheel).read(
            next(name for name in names if name.endswith("/WHEEL"))).decode())
        self.assertFalse([name for name in names if name.endswith((".cpp", ".h", ".a"))])


if __name__ == "__main__":
    shutil.rmtree(BUILD / "wheels", ignore_errors=True)
    made = subprocess.run([PYTHON, ROOT / "deploy/make-wheels", BUILD / "wheels", BUILD, PYTHON],
                          env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})
    if made.returncode != 0:
        sys.exit(made.returncode)
    unittest.main(argv=sys.argv[:1])
