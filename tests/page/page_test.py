"""Tests of the page in a browser, with a server that solves problems.

usage: page_test.py BINARIES SCREENSHOTS [AXE] [TEST ...]
BINARIES holds marble-server and marble; SCREENSHOTS is where pictures go; AXE is axe.min.js, or "-" without it.
"""

import csv
import io
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request
from pathlib import Path

from selenium.webdriver.common.keys import Keys

sys.path.append(str(Path(__file__).resolve().parents[1] / "deploy"))

from browser import Browser
from postgresql import PROGRAMS, PostgreSQL
from server import Server, eventually, free_port

BINARIES, SCREENSHOTS, AXE = sys.argv[1], Path(sys.argv[2]), sys.argv[3]

# Whether a canvas contains more than a few colours.
DRAWN = """
    const canvas = document.querySelector(arguments[0]);
    if (!canvas || !canvas.width) return false;
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    const colours = new Set();
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200) colours.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]);
    return colours.size > 10"""


def fetch(url, token=None):
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {token}"} if token else {})
    with urllib.request.urlopen(request, timeout=30) as answer:
        return answer.read().decode()


def metric(server, line):
    """The sum of the series that start with this text."""
    values = [float(text.rsplit(" ", 1)[1]) for text in fetch(server.http + "/metrics").splitlines()
              if text.startswith(line)]
    assert values, line
    return sum(values)


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.browser = Browser()

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()

    def setUp(self):
        self.servers = []
        self.browser.size(1440, 900)
        self.browser.scheme("light")
        self.browser.complaints()

    def tearDown(self):
        self.browser.driver.get("about:blank")
        for server in self.servers:
            server.stop()

    def start(self, *flags, **keywords):
        server = Server(BINARIES, *flags, **keywords)
        self.servers.append(server)
        return server

    def open(self, server, path="/"):
        self.browser.open(server.http + path)

    def live(self):
        self.browser.wait_text("#state-text", "serving")

    def count_of_jobs(self, count):
        self.browser.wait_text("#job-count", "1 job" if count == 1 else f"{count} jobs")

    def test_numbers_agree_with_the_command_line_and_prometheus(self):
        server = self.start()
        rocket, tiny = server.example("rocket"), server.tiny()
        server.run("solve", "--quiet", rocket, tiny)
        server.run("solve", "--quiet", "--option", "max_iterations=3", rocket, check=False)
        server.run("mpc", "hopper", "--control-steps", 3)
        self.open(server)
        self.count_of_jobs(4)
        info, jobs = server.info(), server.jobs()
        for name in ("accepted", "answered", "solved", "updates", "refused", "failed"):
            self.browser.wait_text(f"#{name}", str(info[name]))
            self.assertEqual(self.browser.text(f"#{name}"), str(info[name]), name)
        self.assertEqual(metric(server, "marble_jobs_accepted_total"), info["accepted"])
        self.assertEqual(metric(server, "marble_solves_total"), info["answered"] + info["updates"])
        self.assertEqual(metric(server, "marble_session_updates_answered_total"), info["updates"])
        self.assertEqual(self.browser.text("#cancelled"), str(info["cancelled"]))
        self.assertEqual(self.browser.text("#sessions"), f"{info['sessions']} of {info['sessions_limit']}")
        self.assertEqual(self.browser.text("#workers"), str(info["workers"]))
        self.assertEqual(self.browser.text("#queued"), "0")
        rows = {row["job"]: row for row in self.browser.rows()}
        self.assertEqual(set(rows), {job["job_id"] for job in jobs})
        for job in jobs:
            row = rows[job["job_id"]]
            self.assertIn(job["status"].replace("_", " "), row["status"])
            self.assertEqual(row["client"], job["client"])
            self.assertEqual(row["name"], job["name"])
            self.assertEqual(row["kind"], job["kind"])
            self.assertEqual(row["priority"], job["priority"])
            self.assertEqual(row["iterations"], str(job["iterations"]))
            sizes = [job[part] for part in ("variables", "equalities", "inequalities", "pairs")]
            self.assertEqual(row["size"].replace("\u202f", ""), " / ".join(map(str, sizes)))
        self.assertEqual(self.browser.complaints(), [])

    def test_the_last_minute_includes_updates_from_before_the_page_was_opened(self):
        server = self.start()
        self.open(server)
        self.live()
        self.browser.wait_text("#success", "none finished in the last minute")
        self.browser.driver.get("about:blank")
        server.run("mpc", "hopper", "--control-steps", 3)
        self.open(server)
        self.browser.wait_text("#success", "100 % solved, last minute")
        self.assertEqual(self.browser.find("#success").get_attribute("title"), "4 of 4 solves in the last minute")
        self.count_of_jobs(1)
        self.assertEqual(self.browser.text("#job-count"), "1 job")

    def test_running_and_waiting_jobs_are_shown_as_such(self):
        server = self.start("--workers", "1")
        self.open(server)
        self.live()
        chain = server.chain(1000)
        first = server.submit(chain, *Server.ENDLESS)
        second = server.submit(chain, *Server.ENDLESS)
        self.browser.wait_text("#busy", "1")
        self.browser.wait_text("#queued-interactive", "1")
        row = f".job-row[data-job='{first}']"
        self.browser.wait_text(f"{row} .status", "running")
        self.browser.wait_text(f".job-row[data-job='{second}'] .status", "queued")
        before = int(self.browser.text(f"{row} .iterations").replace("\u202f", ""))
        eventually(lambda: int(self.browser.text(f"{row} .iterations").replace("\u202f", "")) > before + 10, "iterations")
        self.browser.wait("return document.querySelector(arguments[0]).getAttribute('d')?.length > 20", f"{row} path")
        self.browser.wait_text("title", "1 running, 1 waiting")
        self.browser.wait("return Number(document.querySelector('#plot-busy canvas').dataset.points) > 2")

    def test_a_new_page_shows_the_minutes_before_it_was_opened(self):
        server = self.start()
        server.run("solve", "--quiet", server.tiny())
        kept = lambda: json.loads(fetch(server.http + "/api/history"))
        eventually(lambda: kept()["time_s"][-1] - kept()["time_s"][0] > 4, "some seconds of history")
        self.open(server)
        for plot in ("busy", "queue", "rate"):
            self.browser.wait(f"return Number(document.querySelector('#plot-{plot} canvas').dataset.since) > performance.now() / 1000 + 2")
        self.browser.wait("return Number(document.querySelector('#plot-latency canvas').dataset.points) > 0")
        self.browser.wait("return /s$/.test(document.querySelector('#p50').textContent) && /s$/.test(document.querySelector('#p99').textContent)")
        self.assertEqual(self.browser.complaints(), [])

    def test_the_use_of_the_workers_is_shown_by_client(self):
        server = self.start("--workers", "1")
        server.environment["MARBLE_CLIENT_NAME"] = "hog"
        server.submit(server.chain(1000), *Server.ENDLESS)
        server.environment["MARBLE_CLIENT_NAME"] = "patient"
        server.submit(server.tiny())
        self.open(server, "/#/clients")
        shares = lambda: {name: cells for name, *cells in self.browser.run("""
            return [...document.querySelectorAll('.clients tbody tr')].map((row) => [...row.children].map((cell) => cell.textContent))""")}
        eventually(lambda: shares().get("hog", [""])[0] == "1" and shares().get("patient", ["", ""])[1] == "1", shares)
        self.assertFalse(self.browser.find("#jobs-table").is_displayed())
        self.browser.wait("return [...document.querySelectorAll('.clients a')].some((link) => link.textContent === 'patient' && (link.click(), true))")
        self.browser.wait_text("#job-count", "1 of 2 jobs")
        self.assertEqual([row["client"] for row in self.browser.rows()], ["patient"])
        self.assertRegex(self.browser.rows()[0]["status"], r"queued · 1st$")
        self.assertEqual(self.browser.complaints(), [])

    def fleet(self, count, *flags):
        """Servers that share a store, each seen by the first one; and the store."""
        database = PostgreSQL()
        self.addCleanup(database.close)
        servers = [self.start("--state", database.uri, "--state-lease-s", "3", *flags) for _ in range(count)]
        eventually(lambda: len(json.loads(fetch(servers[0].http + "/api/servers"))["servers"]) == count, "all servers")
        return database, servers

    def servers_shown(self):
        """Cells of the servers' table after the first one, by name."""
        return {name: cells for name, _, *cells in self.browser.run("""
            return [...document.querySelectorAll('.servers tbody tr')].map((row) => [row.dataset.name, ...[...row.children].map((cell) => cell.textContent)])""")}

    @unittest.skipUnless(PROGRAMS.exists(), "PostgreSQL is not installed")
    def test_the_servers_of_a_fleet_are_on_one_page(self):
        database, (first, second, third) = self.fleet(3, "--workers", "2")
        name = lambda server: f"{os.uname().nodename}:{server.address.rsplit(':', 1)[1]}"
        third.run("solve", "--quiet", third.tiny())
        for _ in range(2):
            second.begin("solve", "--quiet", second.chain(1000), *Server.ENDLESS)
        self.open(first)
        self.browser.wait("return !document.querySelector('#tab-servers').hidden")
        self.browser.find("#tab-servers").click()
        eventually(lambda: self.servers_shown().get(name(second), [""] * 3)[2] == "2 of 2", self.servers_shown)
        eventually(lambda: self.servers_shown()[name(third)][5] == "1", self.servers_shown)
        self.assertEqual(self.servers_shown()[name(first)][2], "0 of 2")
        self.assertRegex(self.servers_shown()[name(third)][6], r"s$")
        for place, text in (("servers", "3"), ("busy", "2"), ("workers", "6"), ("states", "none lost")):
            self.browser.wait_text(f"#all-{place}", text)
        self.browser.wait_text("#all-slowest", name(third))
        self.assertFalse(self.browser.find("#now").is_displayed())
        links = self.browser.run("return [...document.querySelectorAll('.servers a')].map((link) => link.href)")  # at once: rows are made anew
        self.assertEqual([link.rstrip("/") for link in links][:3].count(second.http), 1)
        second.process.kill()
        second.process.wait()
        eventually(lambda: re.match(r"✕lost since .*\d", self.servers_shown()[name(second)][0]), self.servers_shown)
        self.assertEqual(self.servers_shown()[name(second)][2], "–")
        for place, text in (("servers", "2"), ("busy", "0"), ("workers", "4"), ("states", "1 lost")):
            self.browser.wait_text(f"#all-{place}", text)
        self.assertEqual(self.browser.run("return [...document.querySelectorAll('.servers .lost a')].length"), 0, "its page is gone too")
        database.kill()
        self.browser.wait_text("#servers-table .note", "The store cannot be read")
        database.start()
        self.browser.wait_text("#servers-table .note", "Each server reports itself")
        self.browser.wait("return [...document.querySelectorAll('.servers a')].some((link) => link.href.startsWith(arguments[0]) && (link.click(), true))", third.http)
        self.browser.wait_text("#host", third.http.split("//")[1])
        self.browser.wait_text("#job-count", "1 job")
        self.assertEqual(self.browser.complaints(), [])

    @unittest.skipUnless(PROGRAMS.exists(), "PostgreSQL is not installed")
    def test_reports_of_others_cannot_change_the_page(self):
        database, (server,) = self.fleet(1)
        database.ask("INSERT INTO marble_servers VALUES ('x', '<b>bold</b>', E'\\u202eevil', 'javascript:alert(1)', 'v', 'serving', now(), now(), 1, 9, 0, 0, 0, 0, 'NaN', 'NaN')")
        self.open(server, "/#/servers")
        eventually(lambda: "<b>bold</b>" in self.servers_shown(), self.servers_shown)
        self.assertEqual(self.servers_shown()["<b>bold</b>"][2], "9 of 1")
        self.browser.wait_text("#servers-table", "<b>bold</b>?evil")
        self.assertEqual([link.get_attribute("href") for link in self.browser.all(".servers a")], [f"{server.http}/#/"])
        self.assertEqual(self.browser.complaints(), [])

    @unittest.skipUnless(PROGRAMS.exists(), "PostgreSQL is not installed")
    def test_the_table_of_servers_fits_small_and_large_screens(self):
        database, servers = self.fleet(3, "--workers", "2")
        for server in servers:
            server.run("solve", "--quiet", server.tiny())
        servers[1].begin("solve", "--quiet", servers[1].chain(1000), *Server.ENDLESS)
        servers[2].process.kill()
        servers[2].process.wait()
        for scheme in ("light", "dark"):
            self.browser.scheme(scheme)
            for width, height in ((390, 844), (1440, 900), (3840, 2160)):
                self.browser.size(width, height)
                self.open(servers[0], "/#/servers")
                self.browser.wait_text("#all-states", "1 lost")
                wide = self.browser.run("return document.documentElement.scrollWidth")
                self.assertLessEqual(wide, width, "scrolls sideways")
                inside = self.browser.run("const table = document.querySelector('#servers-table'); return table.scrollWidth <= table.clientWidth")
                self.browser.screenshot(SCREENSHOTS / f"servers-{scheme}-{width}.png")
                self.assertTrue(inside, f"the table scrolls sideways at {width}")

    def test_a_server_without_a_fleet_has_no_list_of_servers(self):
        self.open(self.start())
        self.live()
        self.count_of_jobs(0)
        self.assertFalse(self.browser.find("#tab-servers").is_displayed())
        self.assertEqual(json.loads(fetch(self.servers[0].http + "/api/servers")), {"shared": False})

    def test_unknown_views_and_jobs_are_reported(self):
        server = self.start()
        self.open(server, "/#/job/12")
        self.browser.wait_text("#nowhere", "/job/12")
        self.assertFalse(self.browser.find("#overview").is_displayed())
        self.browser.find("#nowhere a").click()
        self.browser.wait("return !document.querySelector('#overview').hidden && document.querySelector('#nowhere').hidden")
        self.open(server, "/#/jobs/0123456789abcdef")
        self.browser.wait_text("#why", "does not know this job")
        self.assertFalse(self.browser.find("#job-status").is_displayed())

    def test_an_infeasible_result_shows_conflicting_rows_and_can_be_downloaded(self):
        server = self.start()
        path = server.folder / "clash.json"
        path.write_text(json.dumps({
            "name": "clash", "n": 2, "g": [1, 1], "A": {"rows": 2, "cols": 2, "i": [0, 0, 1, 1], "j": [0, 1, 0, 1], "v": [1, 1, 1, 1]},
            "b": [-1, -3], "L": {"rows": 1, "cols": 2, "i": [0], "j": [0], "v": [1]}, "l": [0],
            "R": {"rows": 1, "cols": 2, "i": [0], "j": [1], "v": [1]}, "r": [0]}))
        job = server.submit(path)
        server.run("result", "--wait", job, check=False)
        self.open(server, f"/#/jobs/{job}")
        self.browser.wait_text("#job-status", "infeasible")
        for row in ("equality 0", "equality 1"):
            self.browser.wait_text("#conflict", row)
        self.browser.wait_text("#conflict", "With option explain=true, a smallest set of conflicting rows and pairs is shown here.")
        self.browser.find("#answer").click()
        file = eventually(lambda: next(self.browser.downloads.glob(f"*{job}.json"), None), "the answer")
        content = fetch(f"{server.http}/api/jobs/{job}/result")
        eventually(lambda: file.read_text() == content, "the whole result")
        self.assertEqual(len(json.loads(content)["solution"]["certificate"]), 4)
        self.assertEqual(self.browser.complaints(), [])

    def test_an_infeasible_job_shows_its_conflict_and_whether_it_is_minimal(self):
        server = self.start()
        path = server.folder / "pair.json"
        # z1 = z2 = 1 where pair 1 requires z1 z2 = 0; pair 0 holds with z0 = 0.
        path.write_text(json.dumps({
            "name": "pair", "n": 3, "g": [1, 1, 1], "A": {"rows": 2, "cols": 3, "i": [0, 1], "j": [1, 2], "v": [1, 1]},
            "b": [-1, -1], "L": {"rows": 2, "cols": 3, "i": [0, 1], "j": [0, 1], "v": [1, 1]}, "l": [0, 0],
            "R": {"rows": 2, "cols": 3, "i": [0, 1], "j": [0, 2], "v": [1, 1]}, "r": [0, 0]}))
        job = server.submit(path, "--option", "explain=true")
        server.run("result", "--wait", job, check=False)
        self.open(server, f"/#/jobs/{job}")
        for text in ("equality 0", "equality 1", "complementarity of pair 1", "Minimal: without any one of them"):
            self.browser.wait_text("#conflict", text)
        shown = self.browser.find("#conflict").text
        for text in ("pair 0", "option explain", "multiplier"):
            self.assertNotIn(text, shown)
        unexplained = server.submit(path)  # its certificate is empty: only pairs are in conflict
        server.run("result", "--wait", unexplained, check=False)
        self.open(server, f"/#/jobs/{unexplained}")
        self.browser.wait_text("#conflict", "With option explain=true")
        self.assertNotIn("multiplier", self.browser.find("#conflict").text)
        self.assertEqual(self.browser.complaints(), [])

    def test_an_infeasible_solve_shows_why_although_its_result_is_not_kept(self):
        server = self.start()
        path = server.folder / "bounds.json"
        path.write_text(json.dumps({"name": "bounds", "n": 1, "g": [1], "C": {"rows": 3, "cols": 1, "i": [0, 1, 2], "j": [0, 0, 0], "v": [1, -1, 1]},
                                    "d": [-2, 1, 5]}))
        server.run("solve", "--quiet", path, check=False)
        server.run("solve", "--quiet", "--option", "explain=true", path, check=False)
        explained, unexplained = (job["job_id"] for job in server.jobs())
        self.open(server, f"/#/jobs/{unexplained}")
        for text in ("inequality 0", "inequality 1", "multiplier", "With option explain=true"):
            self.browser.wait_text("#conflict", text)
        self.assertFalse(self.browser.find("#answer").is_displayed())
        self.open(server, f"/#/jobs/{explained}")
        for text in ("inequality 0C z + d ≥ 0", "inequality 1C z + d ≥ 0", "Minimal: without any one of them"):
            self.browser.wait_text("#conflict", text)
        for job in (explained, unexplained):
            self.open(server, f"/#/jobs/{job}")
            self.browser.wait_text("#conflict", "inequality 1")
            self.assertNotIn("inequality 2", self.browser.text("#conflict"))
        server.run("solve", "--quiet", server.tiny())
        self.open(server, f"/#/jobs/{server.jobs()[0]['job_id']}")
        self.browser.wait_text("#job-status", "solved")
        self.assertFalse(self.browser.find("#conflict").is_displayed())
        self.assertEqual(self.browser.complaints(), [])

    def test_an_incomplete_conflict_is_not_minimal_and_a_long_one_is_shortened(self):
        self.open(self.start())
        conflict = {"inequalities": list(range(99)), "right_sides": [7], "minimal": False, "detail": "time_limit_s came first"}
        rows, notes = self.browser.run("""
          return Promise.all([import("/assets/findings.js"), import("/assets/job_tables.js")]).then(([findings, tables]) => {
            const place = document.createElement("div");
            tables.showConflict(place, findings.conflictingParts(arguments[0]));
            return ["tbody tr", ".note"].map((kind) => [...place.querySelectorAll(kind)].map((line) => line.textContent));
          });""", {"conflict": conflict, "more_parts": "3"})
        self.assertEqual((len(rows), rows[0]), (100, "inequality 0C z + d ≥ 0"))
        self.assertEqual(notes[1:], ["and 3 more; the solution has all of them.",
                                     "Not minimal: fewer of them may conflict.", "time_limit_s came first"])

    def test_a_job_shows_the_kind_of_its_solution_and_what_to_try(self):
        server = self.start()
        local = server.submit(server.tiny(), "--option", "max_small_problem_nodes=0")
        server.run("result", "--wait", local)
        self.open(server, f"/#/jobs/{local}")
        self.browser.wait_text("#why", "Kind: local minimum; no bound is known.")
        self.browser.wait_text("#why", "What to try: num_starts=8 searches 8 times")
        server.run("solve", "--quiet", "--option", "max_small_problem_nodes=0", server.tiny("unkept"))  # its result is not stored
        self.open(server, f"/#/jobs/{server.jobs()[0]['job_id']}")
        self.browser.wait_text("#why", "It is not proved that this is the optimum.")
        server.run("solve", "--quiet", server.tiny("proved"))
        self.open(server, f"/#/jobs/{server.jobs()[0]['job_id']}")
        self.browser.wait_text("#why", "Proved optimal: gap")
        self.assertEqual(self.browser.complaints(), [])

    def test_kinds_of_answers_follow_the_table_of_cases_of_all_languages(self):
        self.open(self.start())
        table = json.loads((pathlib.Path(__file__).resolve().parent.parent / "answers/kinds.json").read_text(encoding="utf-8"))
        content = self.browser.run("""
          return import("/assets/shared/solution-kind.js").then(({ kindOf, kindText, whatToTry }) => arguments[0].map(({ facts }) => {
            const words = { proved: false, objective: 0, gap: Infinity, starts: 1, ...facts, bStationary: facts.b_stationary,
              secondOrder: facts.second_order, budgetSpent: facts.budget_spent, globalSearch: facts.global_search };
            return [kindOf(words), kindText(words), whatToTry(words)];
          }));""", table)
        self.assertEqual(content, [[case["kind"], case["text"], case["what_to_try"]] for case in table])

    def test_a_spent_budget_follows_the_table_of_cases_of_all_languages(self):
        self.open(self.start())
        table = json.loads((pathlib.Path(__file__).resolve().parent.parent / "answers/budgets.json").read_text(encoding="utf-8"))
        content = self.browser.run("""
          return import("/assets/findings.js").then(({ explain }) => arguments[0].map(({ options, ...case_ }) => {
            const job = { state: "finished", status: "solved", proved: false, nodes: 0, pairs: 2, objective: 1, gap: Infinity,
              sample_average_stages: [], times: {}, iterations: 1, updates: 0, equality: 0, inequality: 0, complementarity: 0, ...case_ };
            return explain(job, options, [], { second_order: "SECOND_ORDER_NECESSARY" }).lines.join(" ");
          }));""", table)
        self.assertEqual(["has spent max_local_search_factorizations" in text for text in content], [case["spent"] for case in table])

    def test_an_even_sample_of_many_pairs_is_shown(self):
        server = self.start("--trace-pairs", "16")
        server.run("solve", "--quiet", server.example("rocket"))
        [job] = server.jobs()
        self.open(server, f"/#/jobs/{job['job_id']}")
        self.browser.wait_text("#pairs-caption", f"16 of {job['pairs']} pairs are shown")
        self.assertEqual(self.browser.find("#pairs-plot").get_attribute("data-points"), "16")

    def test_two_jobs_are_compared(self):
        server = self.start()
        rocket = server.example("rocket")
        server.run("solve", "--quiet", rocket)
        server.run("solve", "--quiet", "--option", "max_iterations=7", rocket, check=False)
        second, first = [job["job_id"] for job in server.jobs()]
        self.open(server, f"/#/jobs/{first}")
        self.browser.wait("return document.querySelectorAll('#compare option').length === 2")
        self.browser.find(f"#compare option[value='{second}']").click()
        self.browser.wait_text(".comparison", "max_iterations")
        self.browser.wait_text(".comparison", "iteration limit")
        self.browser.wait(DRAWN, "#comparison-plot")
        self.assertIn(f"/with/{second}", self.browser.driver.current_url)
        self.assertEqual(self.browser.complaints(), [])

    def test_a_job_opens_with_its_convergence_its_pairs_and_its_trace(self):
        server = self.start()
        job = server.submit(server.example("rocket"))
        server.run("result", "--wait", job)
        self.open(server)
        self.count_of_jobs(1)
        self.browser.find(f".job-row[data-job='{job}']").click()
        self.browser.wait_text("#job-id", job)
        self.browser.wait_text("#job-status", "solved")
        self.browser.wait(DRAWN, "#convergence")
        self.browser.wait(DRAWN, "#objective-plot")
        self.assertTrue(self.browser.find("#convergence").get_attribute("aria-label"))
        self.browser.wait("return document.querySelector('.pairs-panel canvas, .pairs-panel svg') !== null")
        self.assertIn("Iteration", self.browser.text(".pairs-panel"))
        self.browser.find("#download").click()
        name = f"marble-{job}.csv"
        path = eventually(lambda: next(self.browser.downloads.glob(f"*{job}*.csv"), None), name)
        content = fetch(f"{server.http}/api/jobs/{job}/trace.csv")
        eventually(lambda: path.read_text().replace("\r\n", "\n") == content.replace("\r\n", "\n"), "the whole download")
        self.browser.find("#bundle").click()
        bundle = eventually(lambda: next(self.browser.downloads.glob(f"*{job}.tar.zst"), None), "the bundle")
        eventually(lambda: "same" in server.run("replay", str(bundle), check=False), "the whole bundle, solved again")
        rows = list(csv.DictReader(io.StringIO(content)))
        self.assertEqual(int(rows[-1]["iteration"]), server.jobs()[0]["iterations"])
        timings = self.browser.text("#timings")
        for part in ("queue", "set-up", "factorization", "line search", "polish"):
            self.assertIn(part, timings)
        self.browser.driver.back()
        self.browser.wait("return !document.querySelector('#overview').hidden")
        self.assertEqual(self.browser.complaints(), [])

    def test_a_proof_shows_incumbent_bound_and_nodes(self):
        server = self.start()
        limits = ["--option", "global_search=true", "--option", "node_limit=300", "--option", "relative_gap_tolerance=0"]
        server.run("solve", "--quiet", *limits, server.example("qpec"), check=False)
        [job] = server.jobs()
        self.assertFalse(job["proved"])
        self.open(server, f"/#/jobs/{job['job_id']}")
        self.browser.wait(DRAWN, "#proof-plot")
        content = self.browser.find("#proof-plot").get_attribute("aria-label").replace("\u202f", "")
        numbers = [float(text) for text in re.findall(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", content)]
        for shown, name in zip(numbers, ("incumbent", "bound", "gap", "nodes")):
            self.assertLessEqual(abs(shown - job[name]), 0.06 * abs(job[name]) if name == "gap" else 1e-6 * abs(job[name]), name)
        self.browser.wait_text("#why", "Not proved. The best point has objective")
        facts = self.browser.text("#facts").replace("\u202f", "")
        for name, number in (("Nodes", job["nodes"]), ("Open nodes", job["open_nodes"])):
            self.assertRegex(facts, rf"{name}{number}(?!\d)")
        self.assertIn("tree of branch and bound", self.browser.text("#timings"))
        server.run("solve", "--quiet", "--option", "global_search=true", server.tiny())
        self.open(server)
        self.count_of_jobs(2)
        proofs = [row["proof"] for row in self.browser.rows()]
        self.assertRegex(proofs[0], r"^✓ \d+ nodes?$")
        self.assertRegex(proofs[1], r"^[\d.]+ % · \d+ nodes$")
        self.open(server, f"/#/jobs/{server.jobs()[0]['job_id']}")
        self.browser.wait_text("#why", "Proved optimal: gap")
        server.run("solve", "--quiet", server.tiny())
        self.open(server, f"/#/jobs/{server.jobs()[0]['job_id']}")
        self.browser.wait(DRAWN, "#convergence")
        self.assertFalse(self.browser.find("#proof-plot").is_displayed())
        self.assertEqual(self.browser.complaints(), [])

    def test_a_problem_with_scenarios_shows_its_stages_and_intervals(self):
        server = self.start()
        shop, demand = server.folder / "shop.json", server.folder / "demand.json"
        shop.write_text(json.dumps({"name": "shop", "n": 2, "g": [1, -3],
                                    "Q": {"rows": 2, "cols": 2, "i": [0], "j": [0], "v": [0.1]},
                                    "L": {"rows": 1, "cols": 2, "i": [0], "j": [1], "v": [-1]}, "l": [5],
                                    "R": {"rows": 1, "cols": 2, "i": [0, 0], "j": [0, 1], "v": [1, -1]}, "r": [0]}))
        demand.write_text(json.dumps({"seed": 7, "first_stage": [0], "quantities": [
            {"location": -5, "scale": 10, "effects": [{"part": "l"}]}]}))
        content = server.run("scenarios", "--output", "json", "--initial-sample-size", "8", "--max-sample-size", "256", "--sampler", demand, shop)
        stages = [json.loads(line) for line in content.splitlines()][:-1]
        [job] = server.jobs()
        self.open(server, f"/#/jobs/{job['job_id']}")
        self.browser.wait_text("#job-status", "solved")
        self.browser.wait(f"return document.querySelectorAll('#stages tbody tr').length === {len(stages)}")
        rows = self.browser.driver.execute_script(
            "return [...document.querySelectorAll('#stages tbody tr')].map((row) => [...row.children].map((c) => c.textContent))")
        self.assertEqual([row[0] for row in rows], [str(stage["scenarios"]) for stage in stages])
        for row, stage in zip(rows, stages):
            self.assertAlmostEqual(float(row[2].replace("\u2212", "-")), stage["objective"], delta=1e-3)
        widths = self.browser.driver.execute_script(
            "return [...document.querySelectorAll('.interval-bar')].map((bar) => parseFloat(bar.style.width))")
        self.assertEqual(len(widths), len(stages))
        self.assertLess(widths[-2], 0.5 * widths[0], "the interval closes; after the last stage few scenarios are sampled")
        server.run("solve", "--quiet", server.tiny())
        self.open(server, f"/#/jobs/{server.jobs()[0]['job_id']}")
        self.browser.wait(DRAWN, "#convergence")
        self.assertFalse(self.browser.find("#stages").is_displayed())
        self.assertEqual(self.browser.complaints(), [])

    def test_a_running_job_is_updated(self):
        server = self.start("--trace-pairs", "1000")
        job = server.submit(server.chain(1000), *Server.ENDLESS)
        self.open(server, f"/#/jobs/{job}")
        self.browser.wait_text("#job-status", "running")
        iteration = lambda: int(re.search(r"Iteration (\d+)", self.browser.text(".pairs-panel") or "Iteration 0")[1])
        before = eventually(iteration, "an iteration")
        eventually(lambda: iteration() > before + 5, "more iterations")
        server.run("cancel", job)
        self.browser.wait_text("#job-status", "cancelled")

    def test_the_page_explains_why_a_job_failed(self):
        server = self.start("--solve-bytes", "10000000")
        rocket = server.example("rocket")
        server.run("solve", "--quiet", server.example("hopper"), check=False)
        stopped = server.submit(rocket, "--option", "max_iterations=3")
        server.run("result", "--wait", stopped, check=False)
        jobs = {job["name"]: job["job_id"] for job in server.jobs()}
        self.open(server, f"/#/jobs/{jobs['hopper']}")
        self.browser.wait_text("#job-status", "resource exhausted")
        self.browser.wait_text("#why", "a solver may take at most 10000000")
        self.open(server, f"/#/jobs/{stopped}")
        self.browser.wait_text("#job-status", "iteration limit")
        self.browser.wait_text("#why", "max_iterations")
        self.browser.wait_text("#options", "changed from")
        self.open(server, "/#/jobs/0123456789abcdef")
        self.browser.wait_text("#why", "does not know this job")

    def test_control_characters_are_replaced(self):
        server = self.start()
        server.run("solve", "--quiet", server.tiny("left\u202eright\u2066\u0007"))
        self.open(server)
        self.count_of_jobs(1)
        self.assertEqual([row["name"] for row in self.browser.rows()], ["left?right??"])
        held = r"return /[\u0007\u202e\u2066]/.test(document.documentElement.outerHTML)"
        self.assertFalse(self.browser.driver.execute_script(held))
        self.open(server, f"/#/jobs/{server.jobs()[0]['job_id']}")
        self.browser.wait_text("#job-status", "solved")
        self.browser.wait("return document.body.innerText.includes('left?right??')")
        self.assertFalse(self.browser.driver.execute_script(held))

    def test_only_permitted_clients_can_cancel_a_job(self):
        tokens = Path(tempfile.mkdtemp()) / "tokens"
        lines, secrets = [], {}
        for name, roles in (("planner", "solve"), ("viewer", "observe"), ("boss", "admin")):
            secret, line = subprocess.run([str(Path(BINARIES) / "marble-server"), "--new-token", f"{name}:{roles}"],
                                          capture_output=True, text=True, check=True).stdout.splitlines()
            secrets[name] = secret
            lines.append(line)
        tokens.write_text("\n".join(lines) + "\n")
        server = self.start("--tokens", str(tokens))
        server.environment["MARBLE_TOKEN"] = secrets["planner"]
        job = server.submit(server.chain(1000), *Server.ENDLESS)

        def enter(name):
            self.browser.run("sessionStorage.clear()")
            self.open(server, f"/#/jobs/{job}")
            self.browser.wait("return document.querySelector('#token-dialog').open")
            self.browser.find("#token").send_keys(secrets[name] + Keys.ENTER)
            self.browser.wait_text("#job-status", "running")

        self.open(server)
        enter("viewer")
        self.browser.wait_text("#caller", "viewer · observe")
        self.assertFalse(self.browser.find("#cancel").is_displayed(), "observe does not permit to cancel")
        self.assertNotIn(secrets["viewer"], self.browser.run("return document.documentElement.outerHTML + location"))
        enter("boss")
        eventually(lambda: self.browser.find("#cancel").is_displayed(), "the button")
        self.browser.find("#cancel").click()
        self.browser.wait("return document.querySelector('#confirm-dialog').open")
        self.browser.find("#confirm-yes").click()
        self.browser.wait_text("#job-status", "cancelled")
        self.assertEqual(server.jobs()[0]["status"], "cancelled")

    def test_a_lost_connection_is_shown_and_reopened(self):
        port = free_port()
        server = self.start(http_port=port)
        server.run("solve", "--quiet", server.tiny())
        self.open(server)
        self.count_of_jobs(1)
        self.assertEqual(server.stop(), 0)
        self.browser.wait("return !document.querySelector('#banner').hidden")
        self.browser.wait_text("#banner", "Disconnected")
        self.browser.wait_text("#banner", "The data are from")
        again = self.start(http_port=port)
        self.browser.wait("return document.querySelector('#banner').hidden")
        self.count_of_jobs(0)
        again.run("solve", "--quiet", again.tiny())
        self.count_of_jobs(1)

    # Regression: pages in the back-forward cache kept their streams until the browser had no connection left.
    def test_navigation_leaves_no_stream_open(self):
        server = self.start()
        job = server.submit(server.chain(1000), *Server.ENDLESS)
        for _ in range(6):
            self.open(server, f"/#/jobs/{job}")
            self.browser.wait_text("#job-status", "running")
        self.open(server)
        self.count_of_jobs(1)
        self.browser.driver.back()
        self.browser.driver.back()
        self.browser.wait_text("#job-status", "running")

    def test_a_draining_server_is_shown(self):
        server = self.start("--drain-grace-s", "60")
        self.open(server)
        self.live()
        server.begin("solve", "--quiet", *Server.ENDLESS, server.chain(1000))
        self.browser.wait_text("#busy", "1")
        server.process.terminate()
        self.browser.wait_text("#state-text", "draining")

    def test_no_other_host_is_contacted_and_the_policy_holds(self):
        server = self.start()
        job = server.submit(server.example("rocket"))
        server.run("result", "--wait", job)
        self.browser.requested()
        self.open(server)
        self.count_of_jobs(1)
        self.open(server, f"/#/jobs/{job}")
        self.browser.wait_text("#job-status", "solved")
        self.browser.wait("return document.querySelector('#convergence') !== null")
        requested = [url for url in self.browser.requested() if url.startswith("http")]
        self.assertGreater(len(requested), 5)
        self.assertEqual([url for url in requested if not url.startswith(server.http + "/")], [])
        self.assertEqual(self.browser.complaints(), [])
        # The policy is active: an inline script does not run.
        self.browser.run("const script = document.createElement('script'); script.textContent = 'window.foreign = 1'; document.head.append(script)")
        self.assertIsNone(self.browser.run("return window.foreign ?? null"))
        self.assertIn("Content Security Policy", " ".join(self.browser.complaints()))

    def test_ten_thousand_jobs_stay_smooth_and_the_page_does_not_grow(self):
        server = self.start("--history-jobs", "10000", "--log-level", "off")
        tiny = server.tiny()
        server.run("batch", *([tiny] * 6000))
        self.open(server)
        self.count_of_jobs("6000")
        elements = lambda: self.browser.run("return document.querySelectorAll('*').length")
        heap = lambda: self.browser.run("gc(); gc(); return performance.memory.usedJSHeapSize")
        self.assertLess(elements(), 1500)
        server.run("batch", *([tiny] * 4500))
        self.count_of_jobs("10\u202f000")
        full, lines = heap(), elements()
        for _ in range(3):
            server.run("batch", *([tiny] * 3000))
        answered = str(server.info()["answered"])
        self.browser.wait("return document.querySelector('#answered').textContent.replace('\u202f', '') === arguments[0]", answered)
        self.count_of_jobs("10\u202f000")
        self.assertLess(heap(), 1.3 * full + 4e6, "nine thousand jobs later")
        self.assertLess(elements(), lines + 50)
        grid = ".job-grid"
        self.browser.run("document.querySelector(arguments[0]).scrollTop = 1e9", grid)
        last = eventually(lambda: self.browser.rows()[-1]["job"] if self.browser.rows() else None, "the last line")
        self.browser.run("document.querySelector(arguments[0]).scrollTop = 0", grid)
        eventually(lambda: self.browser.rows()[0]["job"] != last, "the first line")
        self.assertLess(elements(), lines + 50)

    def test_the_table_can_be_filtered_sorted_and_used_by_keyboard(self):
        server = self.start()
        rocket, tiny = server.example("rocket"), server.tiny()
        server.run("solve", "--quiet", tiny, rocket, tiny)
        server.run("solve", "--quiet", "--option", "max_iterations=2", rocket, check=False)
        self.open(server)
        self.count_of_jobs(4)
        body = self.browser.find("body")
        body.send_keys("/")
        self.browser.wait("return document.activeElement.id === 'filter'")
        self.browser.driver.switch_to.active_element.send_keys("rocket")
        self.browser.wait_text("#job-count", "2 of 4 jobs")
        self.assertEqual({row["name"] for row in self.browser.rows()}, {"rocket"})
        self.browser.find("[data-key='iterations'] button").click()
        eventually(lambda: [int(row["iterations"]) for row in self.browser.rows()][-1:] == [2], "falling iterations")
        self.assertEqual(self.browser.find("[data-key='iterations']").get_attribute("aria-sort"), "descending")
        grid = self.browser.find(".job-grid")
        grid.send_keys(Keys.ARROW_DOWN, Keys.ARROW_DOWN, Keys.ENTER)
        self.browser.wait_text("#job-status", "iteration limit")
        self.browser.find("body").send_keys(Keys.ESCAPE)
        self.browser.wait("return !document.querySelector('#overview').hidden")
        self.browser.wait_text("#job-count", "2 of 4 jobs")

    def test_the_page_fits_small_and_large_screens(self):
        server = self.start()
        self.work(server)
        job = server.jobs()[0]["job_id"]
        for width, height, name in ((360, 740, "telephone"), (3840, 2160, "wall")):
            self.browser.size(width, height)
            for path, view in (("/", "overview"), (f"/#/jobs/{job}", "job")):
                self.open(server, path)
                self.live()
                self.browser.wait("return document.querySelector('#job-count').textContent !== ''")
                if view == "job":
                    self.browser.wait("return document.querySelector('#convergence') !== null")
                    self.browser.wait("return document.querySelectorAll('#options tbody tr').length > 5")
                    broken = self.browser.run("""
                        return [...document.querySelectorAll('#options td')].map((cell) => cell.firstChild).filter((text) => {
                          const range = document.createRange();
                          range.selectNode(text);
                          return range.getClientRects().length > 1;
                        }).map((text) => text.textContent)""")
                    self.assertEqual(broken, [], "a number in two lines is another number")
                elif name == "telephone":
                    top = self.browser.run("return document.querySelector('#jobs-table').getBoundingClientRect().top")
                    self.assertLess(top, 0.6 * height, "jobs are in sight")
                wide = self.browser.run("return document.documentElement.scrollWidth")
                outside = self.browser.run("""
                    return [...document.querySelectorAll('main *')].filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
                      .map((e) => e.outerHTML.slice(0, 80)).slice(0, 5)""")
                self.assertLessEqual(wide, width, f"{name} {view} scrolls sideways: {outside}")
                self.browser.screenshot(SCREENSHOTS / f"{name}-{view}.png")

    def work(self, server):
        """Jobs of several clients, as in a laboratory."""
        rocket, gates, hopper, tiny = (server.example("rocket"), server.example("gates"), server.example("hopper"), server.tiny())
        for name in ("arm-planner", "drone-7"):
            server.environment["MARBLE_CLIENT_NAME"] = name
            server.run("solve", "--quiet", rocket, gates, tiny)
        server.environment["MARBLE_CLIENT_NAME"] = "nightly"
        server.run("batch", *([rocket] * 8 + [tiny] * 6))
        server.environment["MARBLE_CLIENT_NAME"] = "walker"
        server.run("mpc", "hopper", "--control-steps", 12)
        server.run("solve", "--quiet", hopper)
        server.environment["MARBLE_CLIENT_NAME"] = "experiments"
        server.run("solve", "--quiet", "--option", "max_iterations=12", "--option", "path=paper", gates, check=False)
        server.run("solve", "--quiet", "--time-limit", "0.02", gates, check=False)
        server.run("solve", "--quiet", "--time-limit", "0.02", server.chain(6000), check=False)

    def test_screenshots(self):
        server = self.start("--workers", "2", "--solve-bytes", "40000000")
        self.open(server)
        self.live()
        server.environment["MARBLE_CLIENT_NAME"] = "walker"
        server.begin("mpc", "hopper", "--control-steps", "100000")
        end = time.monotonic() + float(os.environ.get("MARBLE_PICTURE_S", "0"))
        self.work(server)
        while time.monotonic() < end:
            self.work(server)
            time.sleep(4.0)
        server.environment["MARBLE_CLIENT_NAME"] = "arm-planner"
        proof = server.submit(server.example("qpec"), "--option", "global_search=true", "--option", "relative_gap_tolerance=0")
        chain = server.chain(1000)
        for _ in range(3):
            server.submit(chain, *Server.ENDLESS)
        self.browser.wait_text("#busy", "2")
        self.browser.wait_text(f".job-row[data-job='{proof}'] .proof", "nodes")
        self.browser.wait("return Number(document.querySelector('#queued').textContent) >= 2")
        for scheme in ("light", "dark"):
            self.browser.scheme(scheme)
            self.browser.wait("return getComputedStyle(document.body).colorScheme !== '' && document.querySelectorAll('.job-row').length > 10")
            self.browser.screenshot(SCREENSHOTS / f"overview-{scheme}.png")
        self.browser.scheme("light")
        solved = next(job["job_id"] for job in server.jobs() if job["name"] == "hopper" and job["kind"] == "solve")
        self.open(server, f"/#/jobs/{solved}")
        self.browser.wait("return document.querySelector('#convergence') !== null")
        self.browser.wait_text(".pairs-panel", "Iteration")
        self.browser.wait_text("#options", "path")
        self.browser.screenshot(SCREENSHOTS / "job.png")

    @unittest.skipIf(AXE == "-", "axe-core is not available: it comes from npm")
    def test_axe_finds_no_serious_fault(self):
        if PROGRAMS.exists():
            server = self.fleet(2, "--solve-bytes", "40000000")[1][0]
        else:
            server = self.start("--solve-bytes", "40000000")
        self.work(server)
        running = server.submit(server.chain(1000), *Server.ENDLESS)
        jobs = [server.jobs()[1]["job_id"], running, next(job["job_id"] for job in server.jobs() if "error" in job)]
        for scheme in ("light", "dark"):
            self.browser.scheme(scheme)
            for path in ("/", "/#/clients", "/#/servers", "/#/nothing", f"/#/jobs/{jobs[0]}/with/{jobs[1]}", *(f"/#/jobs/{job}" for job in jobs)):
                self.open(server, path)
                self.live()
                if path == "/#/clients":
                    self.browser.wait("return document.querySelectorAll('.clients tbody tr').length > 0")
                elif path == "/#/servers":
                    self.browser.wait("return document.querySelectorAll('.servers tbody tr').length > 1 || arguments[0]", not PROGRAMS.exists())
                elif path == "/#/nothing":
                    self.browser.wait_text("#nowhere", "Page not found")
                elif "/with/" in path:
                    self.browser.wait("return document.querySelector('#comparison-plot') !== null")
                elif path != "/":
                    self.browser.wait("return document.querySelector('#why').textContent !== ''")
                else:
                    self.browser.wait("return document.querySelectorAll('.job-row').length > 5")
                self.browser.command("Runtime.evaluate", expression=Path(AXE).read_text())
                found = self.browser.driver.execute_async_script(
                    "const done = arguments[0]; axe.run().then((result) => done(result.violations), (fault) => done([{impact: 'critical', id: String(fault), nodes: []}]))")
                serious = [(fault["id"], [node["html"] for node in fault["nodes"]][:3]) for fault in found
                           if fault["impact"] in ("serious", "critical") or fault["id"] == "empty-table-header"]
                self.assertEqual(serious, [], f"{scheme} {path}")


if __name__ == "__main__":
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=2)
