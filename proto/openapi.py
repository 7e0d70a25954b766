"""The description of the HTTP port's API in OpenAPI 3.1. The paths are defined here. The schemas come from the .proto
files by protobuf's JSON mapping, with the original names of the fields and all fields written."""

from __future__ import annotations

import json
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCALARS = {"bool": {"type": "boolean"}, "string": {"type": "string"},
           "int32": {"type": "integer", "format": "int32"},
           **dict.fromkeys(("int64", "uint64"), {"type": "string", "format": "int64", "pattern": "^-?[0-9]+$"}),
           **dict.fromkeys(("double", "float"), {"$ref": "#/components/schemas/Number"})}
# Names that have another meaning in this API.
RENAMED = {"Problem": "ProblemMessage", "google.rpc.Status": "RpcStatus"}


class Message:
    def __init__(self, name, doc, kind):
        self.name, self.doc, self.kind = name, doc, kind
        self.fields = []  # (label, type, name, doc); for an enumeration its values


def parsed(text):
    """{"Solution": Message, "ScenarioQuantity.Distribution": Message, …} of one file."""
    found, open_, doc = {}, [], []
    for line in text.splitlines():
        line = line.strip()
        if line.startswith("//"):
            doc.append(line[2:].strip())
            continue
        if begun := re.match(r"(message|enum|oneof|service) (\w+) \{", line):
            outer = [message.name for message in open_ if message.kind == "message"]
            message = Message(".".join([*outer, begun[2]]), " ".join(doc), begun[1])
            if begun[1] in ("message", "enum"):
                found[message.name] = message
            if not line.endswith("}"):
                open_.append(message)
        elif line == "}":
            open_.pop()
        elif open_ and (field := re.match(r"(?:(optional|repeated) )?(?:([\w.]+) )?(\w+) = \d+", line)):
            owner = next(message for message in reversed(open_) if message.kind != "oneof")
            label = "optional" if open_[-1].kind == "oneof" else field[1]
            owner.fields.append((label, field[2], field[3], " ".join(doc)))
        doc = []
    return found


def contract():
    messages = {}
    for path in sorted((ROOT / "proto/marble/v1").glob("*.proto")):
        messages.update(parsed(path.read_text(encoding="utf-8")))
    return messages


def component(name):
    return RENAMED.get(name, name.replace(".", ""))


def ref(name):
    return {"$ref": f"#/components/schemas/{name}"}


class Schemas:
    def __init__(self):
        self.messages = contract()
        self.made = {}
        self.asked = set()  # messages of requests: none of their fields is required

    def type_of(self, owner, kind):
        inner = f"{owner}.{kind}"
        return inner if inner in self.messages else kind

    def reached(self, name, without=()):
        there, ahead = set(), [name]
        while ahead:
            message = self.messages.get(ahead.pop())
            if message is None or message.name in there:
                continue
            there.add(message.name)
            ahead += [self.type_of(message.name, kind) for _, kind, field, _ in message.fields
                      if kind and (message.name, field) not in without]
        return there

    def field(self, owner, label, kind, doc):
        kind = self.type_of(owner, kind)
        one = SCALARS[kind] if kind in SCALARS else ref(component(kind))
        if label == "repeated":
            return {"type": "array", "items": one, "description": doc}
        return {**one, "description": doc}

    def add(self, name):
        for one in sorted(self.reached(name)):
            message = self.messages[one]
            if component(one) in self.made:
                continue
            if message.kind == "enum":
                means = "\n".join(f"- {value}: {doc}" for _, _, value, doc in message.fields)
                self.made[component(one)] = {"type": "string", "enum": [value for _, _, value, _ in message.fields],
                                             "description": f"{message.doc}\n\n{means}"}
                continue
            self.made[component(one)] = self.object_of(message)
        return ref(component(name))

    def object_of(self, message):
        made = {"type": "object", "description": message.doc,
                "properties": {field: self.field(message.name, label, kind, doc)
                               for label, kind, field, doc in message.fields}}
        always = [field for label, kind, field, _ in message.fields if label == "repeated" or (label is None and (
            kind in SCALARS or getattr(self.messages.get(self.type_of(message.name, kind)), "kind", "") == "enum"))]
        if always and message.name not in self.asked:
            made["required"] = always
        return made


def problem_schemas(table):
    def vector(doc):
        return {"type": "array", "items": {"type": "number"}, "description": doc}
    sizes = {"g": "Gradient, n entries."}
    properties = {
        "name": {"type": "string", "description": "A name for logs and dashboards; at most 256 bytes."},
        "n": {"type": "integer", "minimum": 1, "description": "Number of variables."},
        "c0": {"type": "number", "description": "Constant cost."},
        **{letter: vector(sizes.get(letter, f"Offset {letter}: one entry for each row of its matrix."))
           for letter in table.vectors},
        **{letter: ref("Matrix") for letter in table.matrices},
        "x0": {"type": ["array", "null"], "items": {"type": "number"}, "description": "Starting point, n entries."},
    }
    return {
        "Problem": {
            "type": "object", "required": ["n", "g"], "properties": properties,
            "description": "min 1/2 z'Qz + g'z + c0 s.t. A z + b = 0, C z + d >= 0, 0 <= L z + l complements R z + r >= 0. "
                           "Q has both triangles. Missing parts are empty. Other keys are ignored, except those of a "
                           "JobRequest, which are refused."},
        "Matrix": {
            "type": "object", "required": ["rows", "cols", "i", "j", "v"],
            "description": "A sparse matrix as triplets with indices from 0. Entries with equal coordinates are added.",
            "properties": {"rows": {"type": "integer", "minimum": 0, "description": "Number of rows."},
                           "cols": {"type": "integer", "minimum": 0, "description": "Number of columns, n."},
                           "i": {"type": "array", "items": {"type": "integer"}, "description": "Row of each entry."},
                           "j": {"type": "array", "items": {"type": "integer"}, "description": "Column of each entry."},
                           "v": vector("Value of each entry, finite.")}},
    }


def own_schemas(table):
    return {
        "Number": {"anyOf": [{"type": "number"}, {"type": "string", "enum": ["NaN", "Infinity", "-Infinity"]}],
                   "description": "A double. JSON cannot represent the three special values as numbers."},
        "RpcStatus": {"type": "object", "description": "google.rpc.Status: an error as gRPC returns it.",
                      "properties": {"code": {"type": "integer", "description": "google.rpc.Code."},
                                     "message": {"type": "string", "description": "The error as text."},
                                     "details": {"type": "array", "items": {"type": "object"},
                                                 "description": "Messages, each with its name as `@type`."}}},
        "ErrorDetail": {
            "type": "object", "required": ["code", "field", "index", "value", "bound", "message"],
            "description": "What is wrong, where, and which rule was broken.",
            "properties": {
                "code": {"type": "string", "enum": [row["name"] for row in table.errors.values()],
                         "description": "The kind of error."},
                "field": {"type": "string", "description": "Path of the field, header or limit; empty if there is none."},
                "index": {"type": "integer", "description": "Index of the entry of that field, from 0; -1 if the error concerns the field as a whole."},
                "value": {"type": "string", "description": "The invalid value as text."},
                "bound": {"type": "string", "description": "The rule that was broken."},
                "message": {"type": "string", "description": "The whole error in one line."}}},
        "Error": {"type": "object", "required": ["error"], "properties": {"error": ref("ErrorDetail")},
                  "description": "Why a request was refused."},
        "History": {
            "type": "object", "required": ["time_s", *HISTORY],
            "description": "Counters of the server, two points per second and at most 640: columns of equal length, oldest first.",
            "properties": {
                "time_s": {"type": "array", "items": {"type": "number"}, "description": "Seconds since the server started."},
                **{name: {"type": "array", "items": {"type": ["number", "null"]}, "description": doc}
                   for name, doc in HISTORY.items()}}},
        "ClientShare": {
            "type": "object", "required": ["running", "queued", "done", "busy_s"],
            "description": "A client's use of the workers.",
            "properties": {
                "client": {"type": "string", "description": "Its name; absent for the sum of all others."},
                "running": {"type": "integer", "description": "Running jobs and updates of sessions."},
                "queued": {"type": "integer", "description": "Waiting jobs and updates of sessions."},
                "done": {"type": "integer", "description": "Jobs and updates of sessions answered in the period."},
                "busy_s": {"type": "number", "description": "Seconds of workers in the period, including those of running jobs."}}},
        "Clients": {
            "type": "object", "required": ["seconds", "clients", "others"],
            "properties": {
                "seconds": {"type": "number", "description": "Length of the period, up to five minutes. It may be longer than the "
                            "uptime of a server that has just started."},
                "clients": {"type": "array", "items": ref("ClientShare"), "description": "At most 64 clients, those with the largest use first."},
                "others": {**ref("ClientShare"), "description": "The sum of all others."}},
            "description": "The clients' use of the workers, now and in the last minutes."},
        "ListedServer": {
            "type": "object", "required": ["name", "address", "page", "state", *SERVER],
            "description": "A server's newest report.",
            "properties": {
                "name": {"type": "string", "description": "HOST:PORT."},
                "address": {"type": "string", "description": "Of its gRPC port."},
                "page": {"type": "string", "description": "URL of its HTTP port; empty if it has none."},
                "version": {"type": "string", "description": "Its version."},
                "state": {"type": "string", "enum": ["serving", "draining", "lost"],
                          "description": "lost: it has not reported itself for longer than the setting state_lease_s. It is listed for a day."},
                "this": {"type": "boolean", "description": "Whether it is the server that was asked."},
                **{name: {"type": ["number", "null"], "description": doc} for name, doc in SERVER.items()}}},
        "Servers": {
            "type": "object", "required": ["shared"],
            "properties": {
                "shared": {"type": "boolean", "description": "Whether there is a shared store; without one, the other fields are absent."},
                "waiting": {"type": "integer", "description": "Submitted jobs that no server has taken yet."},
                "age_s": {"type": "number", "description": "Seconds since the list was read from the store."},
                "error": {"type": "string", "description": "Why it could not be read again; else empty."},
                "servers": {"type": "array", "items": ref("ListedServer"), "description": "At most 1000 servers, by name."}},
            "description": "The servers that share a store."},
        "JobResult": {"type": "object", "required": ["job_id"],
                      "properties": {"job_id": {"type": "string", "description": "The job."},
                                     "solution": ref("Solution"), "error": ref("ErrorDetail")},
                      "description": "The result of a job: its solution, solved or not, or the error with which it ended."},
    }


HISTORY = {
    "queued": "Waiting jobs.",
    "running": "Workers that run a job.",
    "done": "Jobs and updates of sessions answered since the start of the server.",
    "busy_s": "Seconds that workers have spent on jobs since the start of the server.",
    "cpu_s": "Processor time of the server since its start, in seconds.",
    "p50_s": "Median time from acceptance to result, over the results of the last ten seconds; null if there were none.",
    "p99_s": "The 99 % quantile of these times.",
}

SERVER = {
    "seen_s": "Seconds since this report.",
    "uptime_s": "Seconds since it started.",
    "workers": "Its workers.",
    "running": "Workers that run a job.",
    "queued": "Jobs and updates of sessions that wait there.",
    "sessions": "Open sessions.",
    "answered_last_minute": "Jobs and updates of sessions answered in the last minute.",
    "solved_last_minute": "Those of them whose solution is solved.",
    "p50_last_minute_s": "Median time from acceptance to result in the last minute; null if there were no results.",
    "p99_last_minute_s": "The 99 % quantile of these times.",
}

REFUSALS = {
    "400": ("BadRequest", "The input breaks a documented rule; field and index show where."),
    "401": ("Unauthenticated", "The caller presented no valid token or certificate."),
    "403": ("Forbidden", "The caller lacks the required role or priority, or is a page of another site."),
    "404": ("NotFound", "The job does not exist, is no longer kept, or is not visible to the caller."),
    "408": ("TooSlow", "The body did not arrive in time."),
    "409": ("NotFinished", "The job has no result yet: try again after Retry-After, or use wait; or it has no bundle."),
    "411": ("NoLength", "The body needs a Content-Length."),
    "413": ("TooLarge", "The body is longer than the server's http_body_bytes."),
    "415": ("NotJson", "The body must be application/json, not compressed."),
    "429": ("TooMany", "A limit of the server or a quota of the client was reached; often Retry-After gives the time after which to try again."),
    "503": ("Unavailable", "The server stops, or cannot store a job now; Retry-After gives the time after which to try again."),
}


def answer(doc, schema=None, kind="application/json", headers=None):
    made = {"description": doc}
    if headers:
        made["headers"] = headers
    if schema:
        made["content"] = {kind: {"schema": schema}}
    return made


def operation(name, doc, answers, refusals, parameters=(), **more):
    made = {"operationId": name, "tags": [more.pop("tag", "jobs")], "summary": doc[0], "description": doc[1],
            "parameters": list(parameters), **more, "responses": dict(answers)}
    for status in refusals.split():
        made["responses"][status] = {"$ref": f"#/components/responses/{REFUSALS[status][0]}"}
    return made


def parameter(name, doc, schema, where="query", required=False):
    return {"name": name, "in": where, "required": required, "description": doc, "schema": schema}


def paths(schemas):
    text = {"type": "string"}
    job = [{"$ref": "#/components/parameters/job_id"}]
    example = {"n": 2, "g": [-2, -4], "Q": {"rows": 2, "cols": 2, "i": [0, 1], "j": [0, 1], "v": [2, 2]},
               "L": {"rows": 1, "cols": 2, "i": [0], "j": [0], "v": [1]}, "l": [0],
               "R": {"rows": 1, "cols": 2, "i": [0], "j": [1], "v": [1]}, "r": [0]}
    stream = "Server-sent events until the client disconnects or the server stops. Event names: "
    open_to_all = {"security": [], "tag": "server"}
    return {
        "/api/jobs": {
            "get": operation(
                "listJobs", ("Lists jobs", "Jobs that wait, run, or have finished recently, newest first: the caller's own, "
                             "or with the role observe those of all clients."),
                {"200": answer("Jobs.", schemas.add("ListJobsResponse"))}, "400 401 403 404",
                [parameter("state", "Only jobs in these states.", {"type": "array", "items": {
                    "type": "string", "enum": ["queued", "running", "idle", "finished"]}}),
                 parameter("client", "Only jobs of this client.", text),
                 parameter("limit", "Largest number of jobs to return; absent means 100.", {"type": "integer", "minimum": 0,
                                                                              "maximum": 10000}),
                 parameter("before", "Only jobs accepted before the job with this id, for the next page.", text)]),
            "post": operation(
                "submitJob", ("Submits a problem", "Queues a job that outlives the connection. The same request_id from the same "
                              "client refers to the same job as long as that is kept, so a submission may be repeated. "
                              "Requires the role solve."),
                {"202": answer("The job was accepted.", schemas.add("SubmitResponse"), headers={
                    "Location": {"description": "Path of the job.", "schema": text}})},
                "400 401 403 408 411 413 415 429 503",
                [parameter("traceparent", "The client's trace, by W3C Trace Context.", text, "header")],
                requestBody={"required": True, "content": {"application/json": {
                    "schema": {"oneOf": [ref("JobRequest"), ref("Problem")]},
                    "examples": {"problem": {"summary": "A problem alone", "value": example},
                                 "request": {"summary": "A problem with options", "value": {
                                     "problem": example, "options": {"num_starts": 4}, "request_id": "first"}}}}}}),
        },
        "/api/jobs/{job_id}": {
            "get": operation("getJob", ("Returns a job", "Its state, its options and its convergence."),
                             {"200": answer("The job.", schemas.add("GetJobResponse"))}, "401 403 404 503", job),
            "delete": operation("deleteJob", ("Deletes a job", "The job and its result are deleted. A job that has not finished is cancelled."),
                                {"200": answer("The job is deleted.", schemas.add("DeleteJobResponse"))}, "401 403 404 503", job),
        },
        "/api/jobs/{job_id}/result": {"get": operation(
            "getResult", ("Returns the result", "The result of a submitted job, for its owner and the role admin."),
            {"200": answer("The result.", ref("JobResult"))}, "400 401 403 404 409 429 503",
            [*job, parameter("wait", "Seconds to wait for the result, at most the server's http_wait_s (60); absent or 0 does "
                             "not wait.", {"type": "number", "minimum": 0})])},
        "/api/jobs/{job_id}/results": {"get": operation(
            "getResults", ("Returns results of an array", "A page of about 1 MiB: one ArrayResultsResponse per line, in the order in "
                           "which elements ended, for the array's owner and the role admin."),
            {"200": {"description": "Results; or the error with which the array ended, after its last result.", "content": {
                "application/json": {"schema": ref("JobResult")},
                "application/x-ndjson": {"schema": schemas.add("ArrayResultsResponse")}}},
             "204": answer("All results have been sent.")}, "400 401 403 404 409 429 503",
            [*job, parameter("after", "Only results after the one with this sequence; absent or 0 means all.",
                             {"type": "integer", "minimum": 0}),
             parameter("wait", "Seconds to wait for a result, at most the server's http_wait_s (60); absent or 0 does not wait.",
                       {"type": "number", "minimum": 0})])},
        "/api/jobs/{job_id}/events": {"get": operation(
            "watchJob", ("Watches a job", f"{stream}`job` (data: a WatchJobsResponse, the first with the trace so far), `end`."),
            {"200": answer("Events.", text, "text/event-stream")}, "401 403 404 429", job)},
        "/api/jobs/{job_id}/bundle": {"get": operation(
            "getBundle", ("Returns a job as a file", "A submitted job with its problem and its result as a replay bundle, a tar "
                          "archive compressed by zstd, for its owner and the role admin. marble replay solves it again."),
            {"200": answer("The file.", {"type": "string", "format": "binary"}, "application/zstd")}, "401 403 404 409 429 503",
            job)},
        "/api/jobs/{job_id}/trace.csv": {"get": operation(
            "getTrace", ("Returns the convergence as a table", "Comma-separated values with a header line."),
            {"200": answer("The table.", text, "text/csv")}, "401 403 404", job)},
        "/api/jobs/{job_id}/cancel": {"post": operation(
            "cancelJob", ("Cancels a job", "A waiting job ends at once, a running one within 100 ms with its best iterate."),
            {"200": answer("The job as it is now.", schemas.add("CancelJobResponse"))}, "401 403 404 503",
            [*job, parameter("Marble-Request", "A header that a page of another site cannot send.", {"type": "string", "enum": ["1"]},
                             "header", True)])},
        "/api/events": {"get": operation(
            "watchAll", ("Watches all jobs and the server", f"{stream}`hello` (a GetInfoResponse without options), `server` "
                         "(Counters and more), `clients` (Clients), `servers` (Servers, with a shared store), `jobs` (a "
                         "WatchJobsResponse) and `reload` (list the jobs again)."),
            {"200": answer("Events.", text, "text/event-stream")}, "401 403 429")},
        "/api/info": {"get": operation(
            "getInfo", ("Returns information about the server", "Version, limits, options with their ranges, counters, and the caller's name and roles."),
            {"200": answer("The information.", schemas.add("GetInfoResponse"))}, "401 403", tag="server")},
        "/api/history": {"get": operation(
            "getHistory", ("Returns the last five minutes", "Counters of the server, two points per second, so that a plot starts with "
                           "data. The stream of events continues from there."),
            {"200": answer("The last minutes.", ref("History"))}, "400 401 403", tag="server")},
        "/api/clients": {"get": operation(
            "getClients", ("Returns the use of the workers", "By client, now and in the last five minutes. With the role observe or "
                           "admin for all clients, else for the caller only."),
            {"200": answer("By client.", ref("Clients"))}, "400 401 403", tag="server")},
        "/api/servers": {"get": operation(
            "getServers", ("Returns the servers that share a store", "As they reported themselves to it, every two seconds. Requires "
                           "the role observe or admin."),
            {"200": answer("The servers.", ref("Servers"))}, "400 401 403", tag="server")},
        "/api/openapi.json": {"get": operation(
            "getDescription", ("Returns this description", "The same for all callers."),
            {"200": answer("OpenAPI 3.1.", {"type": "object"})}, "", **open_to_all)},
        "/healthz": {"get": operation("isAlive", ("Checks whether the process responds", "For probes."),
                                      {"200": answer("It responds.", text, "text/plain")}, "", **open_to_all)},
        "/readyz": {"get": operation(
            "isReady", ("Checks whether the server accepts calls", "For probes and proxies."),
            {"200": answer("It accepts calls.", text, "text/plain"), "503": answer("The reason why not.", text, "text/plain")}, "",
            **open_to_all)},
        "/metrics": {"get": operation(
            "getMetrics", ("Returns metrics for Prometheus", "Only if the setting metrics is on. Requires the role observe."),
            {"200": answer("Text format 0.0.4.", text, "text/plain")}, "401 403", tag="server")},
    }


def description(table):
    """The whole document, as the server returns it."""
    schemas = Schemas()
    schemas.asked = schemas.reached("SolveRequest", without={("SolveRequest", "problem")})
    schemas.made = {**problem_schemas(table), **own_schemas(table)}
    there = paths(schemas)
    for name in ("WatchJobsResponse", "Solution"):
        schemas.add(name)
    request = schemas.messages["SolveRequest"]
    for _, kind, field, _ in request.fields:
        if field != "problem" and kind not in SCALARS:
            schemas.add(kind)
    job_request = schemas.object_of(request)
    job_request["properties"]["problem"] = ref("Problem")
    job_request["additionalProperties"] = False
    job_request["description"] = ("A problem with further fields of a solve request. `problem` may be absent only in a request "
                                  "with coupled blocks.")
    schemas.made["JobRequest"] = job_request
    document = {
        "openapi": "3.1.0",
        "info": {"title": "Marble Server",
                 "version": (ROOT / "deploy/VERSION").read_text(encoding="utf-8").strip(),
                 "summary": "Solves quadratic programs with linear complementarity constraints.",
                 "description": "Jobs over HTTP, with the rules of the gRPC services. Schemas are protobuf's JSON of the "
                                "messages: integers of 64 bits are strings, and fields may be added. A POST needs "
                                "`Content-Type: application/json` or `Marble-Request: 1`, which a form of another site cannot send.",
                 "license": {"name": "Apache-2.0", "identifier": "Apache-2.0"}},
        "servers": [{"url": "/"}],
        "security": [{}, {"token": []}, {"certificate": []}],
        "tags": [{"name": "jobs", "description": "Submit problems, get results."},
                 {"name": "server", "description": "The server itself."}],
        "paths": there,
        "components": {
            "securitySchemes": {
                "token": {"type": "http", "scheme": "bearer", "description": "If the server has tokens."},
                "certificate": {"type": "mutualTLS", "description": "If the server accepts client certificates."}},
            "parameters": {"job_id": parameter("job_id", "The server's id of the job.", {"type": "string"}, "path", True)},
            "responses": {name: answer(doc, ref("Error")) for name, doc in REFUSALS.values()},
            "schemas": dict(sorted(schemas.made.items()))},
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"
