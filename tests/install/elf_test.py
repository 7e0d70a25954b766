"""Programs and libraries of the build tree and of an installation: they search no relative folder for libraries, and are
hardened as deploy/hardening.cmake says. (Those of packages and wheels are checked where they are made.)

Usage: elf_test.py BUILD_DIR
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.dont_write_bytecode = True
import elf

BUILD = pathlib.Path(sys.argv[1]).resolve()
# Not of this build, or tried out where they are made.
LEFT_OUT = ("CMakeFiles", "_deps", "adapters", "packages", "trees", "wheels")
FLAGS = ("-fstack-protector-strong", "-fstack-clash-protection", "-D_FORTIFY_SOURCE=2")


class Elf(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        work = tempfile.TemporaryDirectory(prefix="marble elf ")
        cls.addClassCleanup(work.cleanup)
        cls.prefix = pathlib.Path(work.name) / "prefix"
        elf.run("cmake", "--install", BUILD, "--prefix", cls.prefix)
        cls.built = list(elf.linked_files(BUILD, LEFT_OUT))
        cls.installed = list(elf.linked_files(cls.prefix))

    def test_no_library_is_searched_in_the_current_directory(self):
        self.assertGreater(len(self.built), 5)
        self.assertGreaterEqual({path.name for path in self.installed}, {"marble", "marble-all", "marble-server"})
        self.assertEqual([], [fault for path in self.built + self.installed for fault in elf.search_path_faults(path)])

    def test_the_check_finds_empty_and_relative_entries(self):
        with tempfile.TemporaryDirectory() as folder:
            source, program = pathlib.Path(folder) / "main.c", pathlib.Path(folder) / "program"
            source.write_text("int main(void) { return 0; }\n")
            for entries, faults in (("/usr/lib:", 1), (":/usr/lib", 1), ("lib", 1), ("./lib:/opt::lib", 3), ("$ORIGIN/../lib:/opt", 0),
                                    ("$ORIGINAL", 1)):
                for tags in ("--enable-new-dtags", "--disable-new-dtags"):
                    elf.run("cc", source, "-o", program, f"-Wl,-rpath,{entries},{tags}")
                    self.assertEqual(faults, len(elf.search_path_faults(program)), f"{entries} {tags}")

    def test_a_library_in_the_current_directory_is_not_loaded(self):
        program = next(path for path in self.built if path.name == "marble-all")
        needed = re.findall(r"\(NEEDED\).*\[(.*)\]", elf.run("readelf", "--wide", "--dynamic", program))
        with tempfile.TemporaryDirectory() as folder:
            for name in needed:
                if not name.startswith(("libc.", "libm.", "libgcc", "libstdc++", "ld-linux")):
                    (pathlib.Path(folder) / name).write_text("no library: the loader would say so")
            done = subprocess.run([program, "--version"], cwd=folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_programs_and_libraries_are_hardened(self):
        if shutil.which("hardening-check") is None:
            self.skipTest("hardening-check (devscripts) is not installed")
        self.assertEqual([], elf.hardening_faults(*self.installed))

    def test_every_file_is_compiled_with_the_flags(self):
        commands = json.loads((BUILD / "compile_commands.json").read_text())
        without = {(flag, one["file"]) for one in commands for flag in FLAGS if flag not in one["command"].split()}
        self.assertEqual(set(), without)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
