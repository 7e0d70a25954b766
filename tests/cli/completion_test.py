"""Completion scripts in the shells themselves, manual pages, and suggestions for misspelled words.

Usage: completion_test.py MARBLE
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

MARBLE = pathlib.Path(sys.argv.pop(1)).resolve()
ENVIRONMENT = {**os.environ, "PATH": f"{MARBLE.parent}{os.pathsep}{os.environ['PATH']}", "LC_ALL": "C.UTF-8"}


def marble(*arguments):
    return subprocess.run([MARBLE, *arguments], capture_output=True, text=True, timeout=60, env=ENVIRONMENT)


def words_of_help(*arguments):
    """The commands or options that a help lists."""
    text = marble(*arguments, "--help").stdout
    if not arguments:
        return re.findall(r"^  (\w+) ", text.partition("Subcommands:\n")[2], re.MULTILINE)
    options = text.partition("Options:\n")[2]
    names = re.findall(r"^  (-\S+)", options, re.MULTILINE)
    return [name for each in names for name in each.split(",") if name.startswith("--")]


COMMANDS = words_of_help()


class Completion(unittest.TestCase):
    def script(self, shell):
        run = marble("completion", shell)
        self.assertEqual((run.returncode, run.stderr), (0, ""))
        return run.stdout

    def need(self, shell):
        if shutil.which(shell) is None:
            self.skipTest(f"{shell} is not installed")

    def bash(self, line, where="/"):
        """What bash offers at the end of a line, split as it splits lines: an = is a word of its own."""
        words = [word for part in line.split(" ") for word in (re.findall(r"=|[^=]+", part) or [""])]
        if line.endswith("="):
            words[-1:] = ["="]
        code = (f"{self.script('bash')}\nCOMP_WORDS=({' '.join(repr(word) for word in words)})\n"
                f"COMP_CWORD={len(words) - 1}\n_marble\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"")
        run = subprocess.run(["bash", "-c", code], capture_output=True, text=True, cwd=where, timeout=60, env=ENVIRONMENT)
        self.assertEqual(run.returncode, 0, run.stderr)
        return run.stdout.split("\n")[:-1]

    def test_bash_offers_commands_options_and_values(self):
        self.assertGreater(len(COMMANDS), 20)
        self.assertEqual(set(self.bash("marble ")), {*COMMANDS, "-h", "--help", "--version"})
        self.assertEqual(self.bash("marble so"), ["solve"])
        self.assertEqual(self.bash("marble --ver"), ["--version"])
        for command in COMMANDS:
            self.assertEqual(set(self.bash(f"marble {command} --")), set(words_of_help(command)), command)
        self.assertEqual(self.bash("marble solve --output "), ["text", "json"])
        self.assertEqual(self.bash("marble solve --output=j"), ["json"])
        self.assertEqual(self.bash("marble solve --output="), ["text", "json"])
        self.assertEqual(self.bash("marble solve --priority r"), ["realtime"])
        self.assertEqual(self.bash("marble solve --option max_it"), ["max_iterations="])
        self.assertEqual(self.bash("marble example h"), ["hopper"])
        self.assertEqual(self.bash("marble completion "), ["bash", "zsh", "fish"])

    def test_bash_offers_files_with_spaces(self):
        with tempfile.TemporaryDirectory() as folder:
            for name in ("a problem.json", "another.json"):
                pathlib.Path(folder, name).touch()
            for line in ("marble solve a", "marble solve --trace a", "marble solve another.json a"):
                self.assertEqual(sorted(self.bash(line, folder)), ["a problem.json", "another.json"])

    def test_zsh_offers_the_same(self):
        self.need("zsh")
        with tempfile.TemporaryDirectory() as folder:
            pathlib.Path(folder, "_marble").write_text(self.script("zsh"))
            # Zsh's own functions print what they are given: completion itself needs a terminal.
            code = ("function _arguments { print -rl -- \"$@\"; state=command; return 1 }\n"
                    "function _describe { print -rl -- ${(P)4} }\n"
                    "function compadd { print -rl -- ${@:4} }\n"
                    "function compdef { }\n"
                    "source $1/_marble; state=argument; words=(marble); _marble\n"
                    "print SECTION; _marble_solver_options; print SECTION\n"
                    "function _arguments { [[ $1 == -C ]] && { state=argument; return 1 }; print -rl -- \"$@\" }\n"
                    "for one in $@[2,-1]; do print -r -- \"COMMAND $one\"; words=($one); _marble; done")
            run = subprocess.run(["zsh", "-f", "-c", code, "zsh", folder, *COMMANDS], capture_output=True, text=True,
                                 timeout=60, env=ENVIRONMENT)
        self.assertEqual(run.stderr, "")
        first, options, rest = run.stdout.split("SECTION\n")
        self.assertEqual(set(re.findall(r"^([a-z]\w*):", first, re.MULTILINE)), set(COMMANDS))
        self.assertIn("max_iterations=", options.split())
        parts = re.split(r"^COMMAND (\w+)\n", rest, flags=re.MULTILINE)[1:]
        for command, given in zip(parts[::2], parts[1::2], strict=True):
            self.assertEqual(set(re.findall(r"^\*?(--[\w-]+)\[", given, re.MULTILINE)), set(words_of_help(command)))

    def test_fish_offers_the_same(self):
        self.need("fish")

        def offered(line):
            run = subprocess.run(["fish", "--no-config", "-c", f"{self.script('fish')}\ncomplete -C '{line}'"],
                                 capture_output=True, text=True, timeout=60, cwd="/", env={**ENVIRONMENT, "HOME": "/nowhere"})
            self.assertEqual(run.returncode, 0, run.stderr)
            return [each.split("\t")[0] for each in run.stdout.splitlines()]

        self.assertEqual(set(offered("marble ")), set(COMMANDS))
        for command in ("solve", "watch", "mpc"):
            self.assertEqual({word for word in offered(f"marble {command} --") if word.startswith("--")},
                             set(words_of_help(command)))
        self.assertEqual(offered("marble solve --output "), ["json", "text"])
        self.assertEqual(offered("marble solve --option max_it"), ["max_iterations="])
        self.assertEqual(offered("marble example hop"), ["hopper"])

    def test_other_shells_are_refused(self):
        self.assertEqual(marble("completion", "tcsh").returncode, 2)
        self.assertEqual(marble("completion").returncode, 2)


class Manual(unittest.TestCase):
    def test_each_command_has_a_page_that_man_can_read(self):
        with tempfile.TemporaryDirectory() as folder:
            pages = pathlib.Path(folder, "new", "man1")
            self.assertEqual(marble("manual", "--directory", pages).returncode, 0)
            self.assertEqual({path.name for path in pages.iterdir()},
                             {"marble.1", *(f"marble-{command}.1" for command in COMMANDS)})
            for path in pages.iterdir():
                command = path.stem.partition("-")[2]
                text = path.read_text(encoding="utf-8")
                run = marble("manual", *([command] if command else []))
                self.assertEqual((run.returncode, run.stdout), (0, text))
                self.assertNotRegex(text, r"(?m)^\.(?!TH |SH |TP$|PP$)", "a request that is none of these")
                if shutil.which("groff") is None:
                    continue
                shown = subprocess.run(["groff", "-man", "-Tutf8", "-k", "-ww", "-rLL=200n", "-P-c", path],
                                       capture_output=True, text=True, timeout=60, env=ENVIRONMENT)
                self.assertEqual(shown.stderr, "", path.name)
                plain = re.sub(r".\x08", "", shown.stdout).replace("\u2010", "-").replace("\u2212", "-")
                for word in words_of_help(command) if command else COMMANDS:
                    self.assertIn(word, plain)
                self.assertIn("NAME", plain)

    def test_what_cannot_be_written_or_is_no_command_is_an_error(self):
        run = marble("manual", "sovle")
        self.assertEqual((run.returncode, run.stdout), (2, ""))
        self.assertIn("sovle: is not a command", run.stderr)
        run = marble("manual", "--directory", "/dev/null/pages")
        self.assertEqual(run.returncode, 2)
        self.assertIn("/dev/null/pages/marble.1: cannot be written", run.stderr)
        self.assertEqual(marble("manual", "solve", "--directory", "/tmp").returncode, 2)


class Suggestions(unittest.TestCase):
    def said(self, *arguments):
        run = marble(*arguments)
        self.assertEqual((run.returncode, run.stdout), (2, ""))
        return run.stderr

    def test_misspelled_words_get_what_they_may_have_meant(self):
        for arguments, words in (
                (["sovle", "x.json"], "marble: sovle: is not a command; did you mean solve?  (marble --help lists them all)"),
                (["exmaple"], "exmaple: is not a command; did you mean example?"),
                (["--verison"], "--verison: is not an option of marble; did you mean --version?"),
                (["solve", "--optoin", "path=paper", "x.json"],
                 "--optoin: is not an option of marble solve; did you mean --option?  (marble solve --help lists them all)"),
                (["solve", "--quite"], "--quite: is not an option of marble solve; did you mean --quiet?"),
                (["solve", "--time_limit=3", "x.json"], "--time_limit: is not an option of marble solve; did you mean --time-limit?"),
                (["solve", "--local", "--option", "max_iter=3", "x.json"], "max_iter: is not an option; did you mean max_iterations?"),
                (["solve", "--local", "--option", "timelimit_s=3", "x.json"], "did you mean time_limit_s?")):
            self.assertIn(words, self.said(*arguments))

    def test_values_of_which_there_are_few_are_listed(self):
        for arguments, words in (
                (["solve", "--priority", "fast", "x.json"], "marble: --priority = fast: must be one of realtime, interactive, batch\n"),
                (["jobs", "--state", "done"], "marble: --state = done: must be one of queued, running, idle, finished\n"),
                (["solve", "--output", "xml", "x.json"], "marble: --output = xml: must be one of text, json\n"),
                (["completion", "tcsh"], "marble: SHELL = tcsh: must be one of bash, zsh, fish\n")):
            self.assertEqual(words, self.said(*arguments))
        self.assertIn("--limit", self.said("jobs", "--limit", "-3"))

    def test_words_like_no_other_get_where_all_are(self):
        for arguments, words in (
                (["qqqq"], "qqqq: is not a command  (marble --help lists them all)"),
                (["marble"], "marble: is not a command  ("),
                (["solve", "--qqqq", "x.json"], "--qqqq: is not an option of marble solve  (marble solve --help lists them all)"),
                (["x" * 1000], "is not a command  ("),
                (["solve", "--local", "--option", "qqqq=1", "x.json"], "qqqq: is not an option  (marble options lists them all)")):
            self.assertIn(words, self.said(*arguments))
        self.assertNotIn("\x1b", self.said("\x1b[31msolv"))
        self.assertIn("required", self.said("solve"))
        self.assertNotIn("did you mean", self.said("solve", "--local", "--option", "node_limit=0", "x.json"))


if __name__ == "__main__":
    unittest.main()
