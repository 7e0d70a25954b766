"""The description at /api/openapi.json: valid OpenAPI 3.1, true of what a real server answers, and enough for a client that
openapi-python-client makes of it.

Usage: openapi_test.py BUILD_DIR [TEST...]
"""

import copy
import importlib
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest
import urllib.error
import urllib.request

import jsonschema
import openapi_spec_validator

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
BINARIES = pathlib.Path(sys.argv.pop(1)) / "bin"
sys.path.insert(0, str(ROOT / "tests/page"))
from server import Server, eventually  # noqa: E402

DESCRIPTION = json.loads((ROOT / "server/http/openapi.json").read_text(encoding="utf-8"))
FIRST = json.loads((ROOT / "README.md").read_text(encoding="utf-8").split("```json\n")[1].split("```")[0])


def strict(schema):
    """The same, but with nothing in an object that it does not name."""
    if isinstance(schema, list):
        return [strict(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    made = {key: strict(value) for key, value in schema.items()}
    if isinstance(made.get("properties"), dict) and made.get("type") == "object":
        made["additionalProperties"] = False
    return made


COMPONENTS = strict(copy.deepcopy(DESCRIPTION["components"]))


def check(value, schema):
    jsonschema.Draft202012Validator({**strict(schema), "components": COMPONENTS}).validate(value)


class ServedTest(unittest.TestCase):
    flags = ()

    def setUp(self):
        self.server = Server(BINARIES, *self.flags)
        self.addCleanup(self.server.stop)

    def ask(self, method, path, body=None, **headers):
        """(status, headers, text), after a look at whether the description says so."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.server.http + path, data, {"Content-Type": "application/json", **headers},
                                         method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                status, got, text = answer.status, answer.headers, answer.read().decode()
        except urllib.error.HTTPError as error:
            status, got, text = error.code, error.headers, error.read().decode()
        self.check_answer(method, path, status, got, text)
        return status, got, text

    def check_answer(self, method, path, status, headers, text):
        parts = path.split("?")[0].split("/")
        if parts[1:3] == ["api", "jobs"] and len(parts) > 3:
            parts[3] = "{job_id}"
        operation = DESCRIPTION["paths"]["/".join(parts)][method.lower()]
        self.assertIn(str(status), operation["responses"], f"{method} {path}: {text}")
        response = operation["responses"][str(status)]
        if "$ref" in response:
            response = DESCRIPTION["components"]["responses"][response["$ref"].split("/")[-1]]
        for name in response.get("headers", {}):
            self.assertIn(name, headers)
        if "content" not in response:
            self.assertEqual(text, "")
            return
        kind, content = next(iter(response["content"].items()))
        self.assertEqual(headers.get_content_type(), kind, path)
        if kind == "application/json":
            check(json.loads(text), content["schema"])

    def submit(self, body, **headers):
        status, _, text = self.ask("POST", "/api/jobs", body, **headers)
        self.assertEqual(status, 202, text)
        return json.loads(text)["job_id"]


class Description(ServedTest):
    def test_it_is_valid_and_served(self):
        openapi_spec_validator.validate(DESCRIPTION)
        status, headers, text = self.ask("GET", "/api/openapi.json")
        self.assertEqual((status, json.loads(text)), (200, DESCRIPTION))
        self.assertTrue(headers["ETag"])

    def test_its_examples_and_problem_files_are_requests(self):
        content = DESCRIPTION["paths"]["/api/jobs"]["post"]["requestBody"]["content"]["application/json"]
        for name, example in content["examples"].items():
            with self.subTest(name):
                check(example["value"], content["schema"])
                self.submit(example["value"])
        whole = json.loads(self.server.run("example", "rocket"))
        jsonschema.Draft202012Validator({**content["schema"], "components": DESCRIPTION["components"]}).validate(whole)
        self.submit(whole)

    def test_what_the_server_answers_is_described(self):
        problem = json.loads(self.server.chain(40).read_text())
        endless = {"problem": problem, "options": {
            "path": "PATH_PAPER", "polish": False, "max_iterations": 1000000, "kappa_initial": 1, "rho_initial": 1,
            "rho_factor": 1.00001, "rho_max": 1e12, "equality_tolerance": 1e-14, "inequality_tolerance": 1e-14,
            "complementarity_tolerance": 1e-14, "stationarity_tolerance": 1e-14}}
        check(endless, {"$ref": "#/components/schemas/JobRequest"})
        endless_id, solved = self.submit(endless), self.submit(FIRST)
        derived = self.submit({"problem": FIRST, "priority": "PRIORITY_BATCH", "request_id": "first", "sensitivity": {
            "losses": {"count": 1, "weights": {"z": [1, 0]}}, "rows": {"matrix": {
                "rows": 1, "columns": 2, "column_pointers": [0, 1, 1], "row_indices": [0], "values": [1]}}}})
        infeasible = self.submit({"n": 1, "g": [0], "A": {"rows": 2, "cols": 1, "i": [0, 1], "j": [0, 0], "v": [1, 1]},
                                  "b": [1, 2]})
        for job in (solved, derived, infeasible):
            status, _, text = self.ask("GET", f"/api/jobs/{job}/result?wait=60")
            self.assertEqual(status, 200, text)
            self.assertEqual(self.ask("GET", f"/api/jobs/{job}")[0], 200)
            self.assertEqual(self.ask("GET", f"/api/jobs/{job}/trace.csv")[0], 200)
        self.assertIn("Infinity", text, "an infeasible problem's bound")
        self.assertEqual(self.ask("GET", f"/api/jobs/{solved}/events")[0], 200)
        self.assertEqual(self.ask("GET", f"/api/jobs/{endless_id}/result")[0], 409)
        self.assertEqual(self.ask("GET", "/api/jobs?state=running&state=finished&limit=7")[0], 200)
        self.assertEqual(self.ask("POST", f"/api/jobs/{endless_id}/cancel", **{"Marble-Request": "1"})[0], 200)
        self.assertEqual(self.ask("DELETE", f"/api/jobs/{endless_id}")[0], 200)
        for path in ("/api/info", "/healthz", "/readyz", "/metrics"):
            self.assertEqual(self.ask("GET", path)[0], 200, path)
        for method, path, body in (("GET", "/api/jobs?limit=x", None), ("GET", "/api/jobs/none", None),
                                   ("GET", f"/api/jobs/{solved}/result?wait=x", None), ("DELETE", "/api/jobs/none", None),
                                   ("POST", "/api/jobs", {"n": 1}), ("POST", "/api/jobs", [])):
            self.assertIn(self.ask(method, path, body)[0], (400, 404))

    def test_scenarios_and_coupled_blocks_are_described(self):
        base = {**FIRST, "name": "scenarios"}
        scenarios = {"problem": base, "scenarios": {
            "first_stage": [0], "samples": {"entries": [{"part": "PROBLEM_PART_GRADIENT", "positions": [1]}],
                                            "values": [-4, -5, -6]}, "out_of_sample_scenarios": "0"}}
        block = {"problem": {"gradient": [-1], "hessian": {"rows": 1, "columns": 1, "column_pointers": [0, 1],
                                                            "row_indices": [0], "values": [1]}},
                 "coupling": {"rows": 1, "columns": 1, "column_pointers": [0, 1], "row_indices": [0], "values": [1]}}
        coupled = {"coupled": {"blocks": [block, block], "coupling_rhs": [1]}}
        for request in (scenarios, coupled):
            check(request, {"$ref": "#/components/schemas/JobRequest"})
            job = self.submit(request)
            status, _, text = self.ask("GET", f"/api/jobs/{job}/result?wait=60")
            self.assertEqual(json.loads(text)["solution"]["status"], "STATUS_SOLVED", text)
            self.ask("GET", f"/api/jobs/{job}")


class GeneratedClient(ServedTest):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="marble openapi ")
        cls.addClassCleanup(cls.folder.cleanup)
        made = subprocess.run(["openapi-python-client", "generate", "--path", str(ROOT / "server/http/openapi.json"),
                               "--meta", "none", "--output-path", f"{cls.folder.name}/marble_http"],
                              capture_output=True, text=True, timeout=120)
        assert made.returncode == 0, made.stdout + made.stderr
        assert "unsupported" not in made.stdout.lower(), made.stdout
        sys.path.insert(0, cls.folder.name)
        new = subprocess.run([str(BINARIES / "marble-server"), "--new-token", "owner:solve"], capture_output=True, text=True,
                             check=True).stdout
        cls.secret, line = new.split("\n", 1)
        tokens = pathlib.Path(cls.folder.name) / "tokens"
        tokens.write_text(line)
        cls.flags = ("--tokens", str(tokens))

    def test_it_submits_waits_reads_lists_cancels_and_deletes(self):
        def call(name, **arguments):
            return importlib.import_module(f"marble_http.api.jobs.{name}").sync_detailed(client=client, **arguments)

        models = importlib.import_module("marble_http.models")
        made = importlib.import_module("marble_http.client")
        client = made.Client(self.server.http)

        def problem_of(json_problem):  # by hand: what is made stumbles over reading a key called "d", which no answer has
            names = set(models.Problem.__annotations__)
            return models.Problem(**{key if key in names else key.lower():
                                     models.Matrix.from_dict(value) if isinstance(value, dict) else value
                                     for key, value in json_problem.items()})

        problem = problem_of(FIRST)
        refused = call("submit_job", body=problem)
        self.assertEqual((refused.status_code, refused.parsed.error.code.value), (401, "unauthenticated"))
        client = made.AuthenticatedClient(self.server.http, token=self.secret, timeout=120)
        submitted = call("submit_job", body=problem)
        self.assertEqual(submitted.status_code, 202)
        job_id = submitted.parsed.job_id
        self.assertEqual(submitted.headers["location"], f"/api/jobs/{job_id}")
        result = call("get_result", job_id=job_id, wait=60).parsed
        self.assertEqual(result.solution.status, models.Status.STATUS_SOLVED)
        self.assertAlmostEqual(result.solution.objective, -4.0)
        self.assertAlmostEqual(result.solution.z[1], 2.0)
        reported = call("get_job", job_id=job_id).parsed
        self.assertEqual(reported.job.state, models.JobState.JOB_STATE_FINISHED)
        self.assertEqual(reported.trace.rows[-1].iteration, int(reported.job.iterations))
        chain = problem_of(json.loads(self.server.chain(40).read_text()))
        options = models.SolveOptions(path=models.Path.PATH_PAPER, polish=False, max_iterations=1000000, kappa_initial=1.0,
                                      rho_initial=1.0, rho_factor=1.00001, rho_max=1e12, equality_tolerance=1e-14,
                                      inequality_tolerance=1e-14, complementarity_tolerance=1e-14,
                                      stationarity_tolerance=1e-14)
        endless = call("submit_job", body=models.JobRequest(problem=chain, options=options, request_id="mine")).parsed.job_id
        eventually(lambda: call("get_job", job_id=endless).parsed.job.state == models.JobState.JOB_STATE_RUNNING, "running")
        early = call("get_result", job_id=endless)
        self.assertEqual((early.status_code, early.parsed.error.code.value), (409, "failed_precondition"))
        listed = call("list_jobs", state=[models.ListJobsStateItem.RUNNING]).parsed
        self.assertEqual([job.job_id for job in listed.jobs], [endless])
        self.assertEqual(listed.jobs[0].request_id, "mine")
        self.assertEqual(call("cancel_job", job_id=endless, marble_request=models.CancelJobMarbleRequest.VALUE_0).status_code, 200)
        ended = call("get_result", job_id=endless, wait=60).parsed
        self.assertEqual(ended.solution.status, models.Status.STATUS_CANCELLED)
        self.assertEqual(call("delete_job", job_id=endless).status_code, 200)
        self.assertEqual(call("get_result", job_id=endless).status_code, 404)
        wrong = call("submit_job", body=models.Problem(n=2, g=[1.0])).parsed
        self.assertEqual((wrong.error.field, wrong.error.bound), ("g", "must have 2 entries (n)"))


if __name__ == "__main__":
    unittest.main()
