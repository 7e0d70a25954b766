"""loadtest/plot: what its figures show of a recorded run, and of a ramp and overload made of it; what it refuses.

Exits with 77 where matplotlib is not installed: then only the refusals are tested.
"""

import copy
import importlib.util
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as tree

HERE = pathlib.Path(__file__).resolve().parent
PLOT = HERE.parent.parent / "loadtest/plot"
RUN = json.loads((HERE / "run.json").read_text())
needs_matplotlib = unittest.skipUnless(importlib.util.find_spec("matplotlib"), "matplotlib is not installed")


def report(kind, **keys):
    return {**{key: value for key, value in RUN.items() if key != "run"}, "kind": kind, **keys}


def ramp():
    steps = [{"rate_per_s": rate, "holds": holds, "why_not": "", "latency_s": 0.02, "run": RUN["run"]}
             for rate, holds in ((20, True), (40, False), (30, True))]
    return report("ramp", objective={"text": "p97=30ms", "part": 0.97, "most_s": 0.03}, best_rate_per_s=30, steps=steps)


def overload():
    steps = [{"level": level, "goodput": 0.7, "useful": 0.9, "run": RUN["run"]} for level in (0.5, 2)]
    return report("overload", capacity_per_s=200, steps=steps)


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="marble plot "))
        self.addCleanup(shutil.rmtree, self.folder)

    def file(self, content, name="report.json"):
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
        return path

    def plot(self, *arguments, python_path=""):
        environment = {**os.environ, "PYTHONPATH": str(python_path), "MPLCONFIGDIR": str(self.folder / "config")}
        return subprocess.run([sys.executable, "-B", PLOT, *arguments], capture_output=True, text=True, timeout=120,
                              env=environment)

    def refused(self, done, *texts):
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertNotIn("Traceback", done.stderr)
        for text in texts:
            self.assertIn(text, done.stderr)


@needs_matplotlib
class Figures(Case):
    def drawn(self, content, *arguments):
        """The texts of the SVG."""
        path = self.file(content)
        done = self.plot(path, *arguments)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        root = tree.parse(path.with_suffix(".svg")).getroot()
        return ["".join(text.itertext()) for text in root.iter("{http://www.w3.org/2000/svg}text")]

    def test_a_run_shows_distribution_latency_answers_and_the_server(self):
        texts = self.drawn(RUN)
        for text in ("Marble under load", "149.3 answers a second; failures: 0",
                     "2 cores, Intel(R) Xeon(R) Processor, Linux x86_64",
                     "Latency: the part of the answers within a time", "Latency over time", "Answers over time",
                     "The server over time", "milliseconds", "seconds since the warm-up", "MiB", "0 %", "90 %", "99 %",
                     "from the intended time", "server: queue", "server: solve", "outside the server", "median", "p99",
                     "longest", "errors", "jobs in the queue", "memory"):
            self.assertIn(text, texts)

    def test_a_ramp_shows_throughput_latency_and_a_distribution_for_each_rate_in_order(self):
        texts = self.drawn(ramp())
        for text in ("highest rate that holds: 30.00 requests a second", "Throughput against offered load",
                     "Latency against offered load", "holds the objective", "does not", "p97", "objective p97=30ms"):
            self.assertIn(text, texts)
        self.assertEqual([text.split(", ")[1] for text in texts if text.startswith("Latency: ")],
                         [f"{rate} requests a second" for rate in (20, 30, 40)])

    def test_overload_shows_goodput_and_latency_by_level_and_the_last_level_over_time(self):
        texts = self.drawn(overload())
        for text in ("capacity: 200.0 answers a second", "Goodput against offered load",
                     "goodput: in time, of the capacity", "useful: of the workers' busy time",
                     "Latency against offered load", "Latency: the part of the answers within a time, 0.5 × capacity",
                     "Answers over time, 2 × capacity"):
            self.assertIn(text, texts)
        self.assertNotIn("Answers over time, 0.5 × capacity", texts)

    def test_one_plot_has_no_heading(self):
        texts = self.drawn(ramp(), "--only", "latency")
        self.assertIn("Latency against offered load", texts)
        self.assertNotIn("Marble under rising load", texts)
        self.assertNotIn("Throughput against offered load", texts)

    def test_a_run_without_answers_has_empty_plots(self):
        content = copy.deepcopy(RUN)
        content["run"]["seconds"] = []
        for name in ("latency", "server_queue", "server_solve", "outside_server"):
            content["run"]["total"][name]["cumulative"] = []
        self.assertEqual(self.drawn(content).count("no data"), 4)

    def test_texts_of_a_file_are_shown_literally(self):
        content = copy.deepcopy(RUN)
        content["machine"]["processor"] = "$\\frac$ <b>\x1b[31m\ud800"
        self.assertIn("2 cores, $\\frac$ <b>?[31m?, Linux x86_64", self.drawn(content))

    def test_the_largest_numbers_are_drawn(self):
        content = copy.deepcopy(RUN)
        for second in content["run"]["seconds"]:
            second.update({key: 1e15 for key in second})
        content["run"]["total"]["latency"]["cumulative"] = [[1e-300, 0.5], [1e15, 1]]
        self.drawn(content)

    def test_the_output_has_the_format_of_its_name_and_the_same_report_makes_the_same_file(self):
        path = self.file(RUN)
        for suffix, start in ((".png", b"\x89PNG"), (".pdf", b"%PDF"), (".svg", b"<?xml")):
            written = []
            for name in ("first", "second"):
                output = self.folder / (name + suffix)
                self.assertEqual(self.plot(path, "--output", output).returncode, 0)
                written.append(output.read_bytes())
            self.assertTrue(written[0].startswith(start))
            self.assertEqual(written[0], written[1])

    def test_good_files_are_drawn_beside_a_bad_one(self):
        bad, good = self.file(b"{", "bad.json"), self.file(RUN, "good.json")
        self.refused(self.plot(bad, good), "bad.json: is not JSON")
        self.assertTrue(good.with_suffix(".svg").exists())

    def test_an_output_that_cannot_be_written_is_named(self):
        output = self.folder / "none" / "figure.svg"
        self.refused(self.plot(self.file(RUN), "--output", output), f"{output} cannot be written: No such file")


class Refusals(Case):
    def test_a_file_that_is_no_report_is_named_with_its_fault(self):
        cases = {b"": "is not JSON", b"\xff": "is not JSON", b"[" * 100_000: "is not JSON",
                 b'{"schema": NaN}': "is not JSON", b"9" * 10_000: "", b"[]": "the whole file must be an object",
                 b"{}": "schema is missing",
                 b'{"schema": "marble/1"}': "schema must be 'marble-load/1'",
                 b'{"schema": "marble-load/1", "kind": ["run"]}': "kind must be one of run, ramp, overload",
                 b'{"schema": "marble-load/1", "kind": "run"}': "run is missing"}
        for content, text in cases.items():
            self.refused(self.plot(self.file(content)), "report.json: ", text)
        self.refused(self.plot(self.folder / "none.json"), "none.json: cannot be read: No such file")
        self.refused(self.plot(self.folder), "cannot be read")

    def test_a_wrong_value_is_named_by_its_key_and_bound(self):
        point = "run.total.server_queue.cumulative[1]"
        cases = ((("seconds", 1, "p50_s"), "0.1", "run.seconds[1].p50_s must be a number from 0 to 1e+15"),
                 (("seconds", 1, "p50_s"), True, "run.seconds[1].p50_s must be a number from 0 to 1e+15"),
                 (("seconds", 1, "p50_s"), -1, "run.seconds[1].p50_s must be a number from 0 to 1e+15"),
                 (("seconds", 1, "at_s"), 10**400, "run.seconds[1].at_s must be a number from -1e+15 to 1e+15"),
                 (("seconds", 1, "queued"), float("1e999"), "is not JSON: Infinity"),
                 (("seconds", 1), 3, "run.seconds[1] must be an object"),
                 (("seconds",), {}, "run.seconds must be an array"),
                 (("total", "server_queue", "cumulative", 1), [1], f"{point} must be a time and a part"),
                 (("total", "server_queue", "cumulative", 1, 1), 1.5, f"{point}[1] must be a number from 0 to 1"))
        for keys, value, text in cases:
            content = copy.deepcopy(RUN)
            at = content["run"]
            for key in keys[:-1]:
                at = at[key]
            at[keys[-1]] = value
            self.refused(self.plot(self.file(content)), f"report.json: {text}")

    def test_a_file_of_an_earlier_marble_load_lacks_a_key(self):
        content = copy.deepcopy(RUN)
        del content["run"]["total"]["latency"]["cumulative"]
        self.refused(self.plot(self.file(content)), "report.json: run.total.latency.cumulative is missing")

    def test_more_steps_than_fit_a_figure_are_refused(self):
        content = ramp()
        content["steps"] *= 34
        self.refused(self.plot(self.file(content)), "report.json: steps has 102 elements, more than 100")

    def test_a_file_larger_than_the_limit_is_not_read(self):
        path = self.file(b"")
        os.truncate(path, 256 * 2**20 + 1)
        self.refused(self.plot(path), "report.json: has more than 268435456 bytes")

    def test_a_plot_that_the_kind_does_not_have_is_refused(self):
        self.refused(self.plot(self.file(RUN), "--only", "goodput"), "report.json: has no plot goodput")

    def test_the_report_is_never_overwritten(self):
        path = self.file(RUN, "report.svg")
        self.refused(self.plot(path), "report.svg: is itself the file to write")
        self.assertEqual(json.loads(path.read_text()), RUN)

    def test_wrong_usage_is_refused(self):
        path = self.file(RUN)
        self.refused(self.plot(), "usage")
        self.refused(self.plot(path, "--output", "figure.gif"), "figure.gif must end in .svg, .png, .pdf")
        self.refused(self.plot(path, path, "--output", "figure.svg"), "--output is for one file")

    def test_without_matplotlib_it_names_the_package(self):
        (self.folder / "matplotlib.py").write_text("raise ImportError('none')\n")
        done = self.plot(self.file(RUN), python_path=self.folder)
        self.refused(done, "matplotlib is not installed", "python3-matplotlib")
        self.assertFalse((self.folder / "report.svg").exists())


result = unittest.main(exit=False).result
sys.exit(1 if not result.wasSuccessful() else 77 if result.skipped else 0)
