"""The description of the HTTP port's API in OpenAPI 3.1: its paths from here, its schemas from the .proto files, by
protobuf's JSON mapping with the names of the fields as they are and all of them written."""

from __future__ import annotations

import json
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parent.parent
SCALARS = {"bool": {"type": "boolean"}, "string": {"type": "string"},
           "int32": {"type": "integer", "format": "int32"},
           **dict.fromkeys(("int64", "uint64"), {"type": "string", "format": "int64", "pattern": "^-?[0-9]+$"}),
           **dict.fromkeys(("double", "float"), {"$ref": "#/components/schemas/Number"})}
# Names that mean something else here.
RENAMED = {"Problem": "ProblemMessage", "google.rpc.Status": "RpcStatus"}


class Message:
    def __init__(self, name, doc, kind):
        self.name, self.doc, self.kind = name, doc, kind
        self.fields = []  # (label, type, name, doc); of an enumeration its values


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
        self.asked = set()  # what requests have: none of its fields must be there

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
        "name": {"type": "string", "description": "For people; at most 256 bytes."},
        "n": {"type": "integer", "minimum": 1, "description": "Number of variables."},
        "c0": {"type": "number", "description": "Constant cost."},
        **{letter: vector(sizes.get(letter, f"Offset {letter}: an entry for each row of its matrix."))
           for letter in table.vectors},
        **{letter: ref("Matrix") for letter in table.matrices},
        "x0": {"type": ["array", "null"], "items": {"type": "number"}, "description": "Where to start, n entries."},
    }
    return {
        "Problem": {
            "type": "object", "required": ["n", "g"], "properties": properties,
            "description": "min 1/2 z'Qz + g'z + c0 s.t. A z + b = 0, C z + d >= 0, 0 <= L z + l complements R z + r >= 0. "
                           "Q has both triangles. What is missing is empty; other keys are ignored, but for those of a "
                           "JobRequest, which are refused."},
        "Matrix": {
            "type": "object", "required": ["rows", "cols", "i", "j", "v"],
            "description": "A sparse matrix as triplets, counted from 0. Entries of equal coordinates add up.",
            "properties": {"rows": {"type": "integer", "minimum": 0, "description": "Rows."},
                           "cols": {"type": "integer", "minimum": 0, "description": "Columns, n."},
                           "i": {"type": "array", "items": {"type": "integer"}, "description": "Row of each entry."},
                           "j": {"type": "array", "items": {"type": "integer"}, "description": "Column of each entry."},
                           "v": vector("Value of each entry, finite.")}},
    }


def own_schemas(table):
    return {
        "Number": {"anyOf": [{"type": "number"}, {"type": "string", "enum": ["NaN", "Infinity", "-Infinity"]}],
                   "description": "A double; JSON has no other way to write the three."},
        "RpcStatus": {"type": "object", "description": "google.rpc.Status: an error as gRPC has it.",
                      "properties": {"code": {"type": "integer", "description": "google.rpc.Code."},
                                     "message": {"type": "string", "description": "For people."},
                                     "details": {"type": "array", "items": {"type": "object"},
                                                 "description": "Messages, each with its name as `@type`."}}},
        "ErrorDetail": {
            "type": "object", "required": ["code", "field", "index", "value", "bound", "message"],
            "description": "What was wrong, where, and the rule it broke.",
            "properties": {
                "code": {"type": "string", "enum": [row["name"] for row in table.errors.values()],
                         "description": "The kind of fault."},
                "field": {"type": "string", "description": "Path of the field, header or limit; empty if there is none."},
                "index": {"type": "integer", "description": "The entry of that field, from 0; -1 of the field as a whole."},
                "value": {"type": "string", "description": "What was there, as text."},
                "bound": {"type": "string", "description": "The rule that was broken."},
                "message": {"type": "string", "description": "All of it in one line."}}},
        "Error": {"type": "object", "required": ["error"], "properties": {"error": ref("ErrorDetail")},
                  "description": "Why a request was refused."},
        "History": {
            "type": "object", "required": ["time_s", *HISTORY],
            "description": "Columns of equal length, oldest first: the server twice a second, at most 640 times.",
            "properties": {
                "time_s": {"type": "array", "items": {"type": "number"}, "description": "Seconds since the server started."},
                **{name: {"type": "array", "items": {"type": ["number", "null"]}, "description": doc}
                   for name, doc in HISTORY.items()}}},
        "ClientShare": {
            "type": "object", "required": ["running", "queued", "done", "busy_s"],
            "description": "What a client has of the workers.",
            "properties": {
                "client": {"type": "string", "description": "Its name; absent of all others together."},
                "running": {"type": "integer", "description": "Jobs and updates of sessions that run now."},
                "queued": {"type": "integer", "description": "Those that wait now."},
                "done": {"type": "integer", "description": "Those that were answered in the time looked at."},
                "busy_s": {"type": "number", "description": "Seconds of workers in that time, with what runs now."}}},
        "Clients": {
            "type": "object", "required": ["seconds", "clients", "others"],
            "properties": {
                "seconds": {"type": "number", "description": "The time looked at, up to five minutes; as a server has just started, it "
                            "may be longer than that runs."},
                "clients": {"type": "array", "items": ref("ClientShare"), "description": "Those that took most first, at most 64."},
                "others": {**ref("ClientShare"), "description": "All others together."}},
            "description": "Who takes the workers, now and in the last minutes."},
        "JobResult": {"type": "object", "required": ["job_id"],
                      "properties": {"job_id": {"type": "string", "description": "The job."},
                                     "solution": ref("Solution"), "error": ref("ErrorDetail")},
                      "description": "What became of a job: its solution, solved or not, or else the error it ended with."},
    }


HISTORY = {
    "queued": "Jobs that wait.",
    "running": "Workers that run a job.",
    "done": "Jobs and updates of sessions answered since the server started.",
    "busy_s": "Seconds that workers have spent on jobs since then.",
    "cpu_s": "Processor seconds of the server since then.",
    "p50_s": "Half of the answers of the last ten seconds took no longer, from acceptance; null where there were none.",
    "p99_s": "The same of 99 in 100 of them.",
}

REFUSALS = {
    "400": ("BadRequest", "The input breaks a documented rule; field and index say where."),
    "401": ("Unauthenticated", "The caller showed no token or certificate that is known."),
    "403": ("Forbidden", "The caller lacks the role or the priority for it, or is a page of another site."),
    "404": ("NotFound", "Never heard of it, no longer kept, or not the caller's to see."),
    "408": ("TooSlow", "The body did not come in time."),
    "409": ("NotFinished", "The job has no answer yet: come back after Retry-After, or wait; or it has no bundle."),
    "411": ("NoLength", "The body needs a Content-Length."),
    "413": ("TooLarge", "The body is longer than the server's http_body_bytes."),
    "415": ("NotJson", "The body must be application/json, not compressed."),
    "429": ("TooMany", "A limit of the server or a quota of the client was reached; often Retry-After tells when to ask again."),
    "503": ("Unavailable", "The server stops, or cannot keep a job now; Retry-After tells when to ask again."),
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
    stream = "Server-sent events, until the client hangs up or the server stops: event names "
    open_to_all = {"security": [], "tag": "server"}
    return {
        "/api/jobs": {
            "get": operation(
                "listJobs", ("Lists jobs", "Jobs that wait, run, or have finished lately, newest first: the caller's own, "
                             "with the role observe everybody's."),
                {"200": answer("Jobs.", schemas.add("ListJobsResponse"))}, "400 401 403 404",
                [parameter("state", "Only jobs in these states.", {"type": "array", "items": {
                    "type": "string", "enum": ["queued", "running", "idle", "finished"]}}),
                 parameter("client", "Only jobs of this client.", text),
                 parameter("limit", "At most this many; absent means 100.", {"type": "integer", "minimum": 0,
                                                                              "maximum": 10000}),
                 parameter("before", "Only jobs accepted before this one, by id: to page on.", text)]),
            "post": operation(
                "submitJob", ("Submits a problem", "Queues a job that outlives the connection. The same request_id by the same "
                              "client is the same job for as long as that is kept: a submission may be repeated. Needs the "
                              "role solve."),
                {"202": answer("The job was taken in.", schemas.add("SubmitResponse"), headers={
                    "Location": {"description": "Path of the job.", "schema": text}})},
                "400 401 403 408 411 413 415 429 503",
                [parameter("traceparent", "The client's trace, by W3C Trace Context.", text, "header")],
                requestBody={"required": True, "content": {"application/json": {
                    "schema": {"oneOf": [ref("JobRequest"), ref("Problem")]},
                    "examples": {"problem": {"summary": "A problem by itself", "value": example},
                                 "request": {"summary": "A problem with options", "value": {
                                     "problem": example, "options": {"starts": 4}, "request_id": "first"}}}}}}),
        },
        "/api/jobs/{job_id}": {
            "get": operation("getJob", ("Tells of a job", "Its state, its options and its convergence."),
                             {"200": answer("The job.", schemas.add("GetJobResponse"))}, "401 403 404 503", job),
            "delete": operation("deleteJob", ("Lets a job go", "With its answer. One that has not finished is cancelled."),
                                {"200": answer("It is gone.", schemas.add("DeleteJobResponse"))}, "401 403 404 503", job),
        },
        "/api/jobs/{job_id}/result": {"get": operation(
            "getResult", ("Tells the answer", "The answer of a submitted job, for its owner and the role admin."),
            {"200": answer("What became of it.", ref("JobResult"))}, "400 401 403 404 409 429 503",
            [*job, parameter("wait", "Seconds to wait for the answer, at most the server's http_wait_s (60); absent or 0 does "
                             "not wait.", {"type": "number", "minimum": 0})])},
        "/api/jobs/{job_id}/events": {"get": operation(
            "watchJob", ("Watches a job", f"{stream}`job` (data: a WatchJobsResponse, the first with the trace so far) and `end`."),
            {"200": answer("Events.", text, "text/event-stream")}, "401 403 404 429", job)},
        "/api/jobs/{job_id}/bundle": {"get": operation(
            "getBundle", ("Tells a job as a file", "A submitted job with its problem and its answer as a replay bundle, a tar "
                          "archive compressed by zstd: for its owner and the role admin. marble replay solves it again."),
            {"200": answer("The file.", {"type": "string", "format": "binary"}, "application/zstd")}, "401 403 404 409 429 503",
            job)},
        "/api/jobs/{job_id}/trace.csv": {"get": operation(
            "getTrace", ("Tells the convergence as a table", "Comma-separated values with a line of names."),
            {"200": answer("The table.", text, "text/csv")}, "401 403 404", job)},
        "/api/jobs/{job_id}/cancel": {"post": operation(
            "cancelJob", ("Ends a job", "A waiting one ends at once, a running one within 100 ms with its best iterate."),
            {"200": answer("The job as it is now.", schemas.add("CancelJobResponse"))}, "401 403 404 503",
            [*job, parameter("Marble-Request", "What no other site's page can send.", {"type": "string", "enum": ["1"]},
                             "header", True)])},
        "/api/events": {"get": operation(
            "watchAll", ("Watches all jobs and the server", f"{stream}`hello` (a GetInfoResponse without options), `server` "
                         "(Counters and more), `clients` (Clients), `jobs` (a WatchJobsResponse) and `reload` (list the "
                         "jobs again)."),
            {"200": answer("Events.", text, "text/event-stream")}, "401 403 429")},
        "/api/info": {"get": operation(
            "getInfo", ("Tells what the server is", "Version, limits, options with their ranges, counters, and who the caller is."),
            {"200": answer("What it is.", schemas.add("GetInfoResponse"))}, "401 403", tag="server")},
        "/api/history": {"get": operation(
            "getHistory", ("Tells the last five minutes", "What the server did, twice a second: for a plot that begins with more "
                           "than nothing. The stream of events goes on from there."),
            {"200": answer("The last minutes.", ref("History"))}, "400 401 403", tag="server")},
        "/api/clients": {"get": operation(
            "getClients", ("Tells who takes the workers", "By client, now and in the last five minutes. With the role observe or "
                           "admin all of them, else the caller alone."),
            {"200": answer("By client.", ref("Clients"))}, "400 401 403", tag="server")},
        "/api/openapi.json": {"get": operation(
            "getDescription", ("This description", "The same for everybody."),
            {"200": answer("OpenAPI 3.1.", {"type": "object"})}, "", **open_to_all)},
        "/healthz": {"get": operation("isAlive", ("Whether the process lives", "For probes."),
                                      {"200": answer("It does.", text, "text/plain")}, "", **open_to_all)},
        "/readyz": {"get": operation(
            "isReady", ("Whether the server takes calls", "For probes and proxies."),
            {"200": answer("It does.", text, "text/plain"), "503": answer("Why not.", text, "text/plain")}, "",
            **open_to_all)},
        "/metrics": {"get": operation(
            "getMetrics", ("Metrics for Prometheus", "Where the server counts (setting metrics). Needs the role observe."),
            {"200": answer("Text format 0.0.4.", text, "text/plain")}, "401 403", tag="server")},
    }


def description(table):
    """The whole text, ready to be served."""
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
    job_request["description"] = ("A problem with what else a solve may be told. `problem` may be absent only of a request with "
                                  "coupled blocks.")
    schemas.made["JobRequest"] = job_request
    document = {
        "openapi": "3.1.0",
        "info": {"title": "Marble Server",
                 "version": (ROOT / "deploy/VERSION").read_text(encoding="utf-8").strip(),
                 "summary": "Solves quadratic programs with linear complementarity constraints.",
                 "description": "Jobs over HTTP, under the rules of the gRPC services. Schemas are protobuf's JSON of the "
                                "messages: integers of 64 bits are strings, fields may be added. A POST needs "
                                "`Content-Type: application/json` or `Marble-Request: 1`, which no other site's form can send.",
                 "license": {"name": "Apache-2.0", "identifier": "Apache-2.0"}},
        "servers": [{"url": "/"}],
        "security": [{}, {"token": []}, {"certificate": []}],
        "tags": [{"name": "jobs", "description": "Problems in, answers out."},
                 {"name": "server", "description": "The server itself."}],
        "paths": there,
        "components": {
            "securitySchemes": {
                "token": {"type": "http", "scheme": "bearer", "description": "Where the server has tokens."},
                "certificate": {"type": "mutualTLS", "description": "Where the server knows client certificates."}},
            "parameters": {"job_id": parameter("job_id", "The server's id of the job.", {"type": "string"}, "path", True)},
            "responses": {name: answer(doc, ref("Error")) for name, doc in REFUSALS.values()},
            "schemas": dict(sorted(schemas.made.items()))},
    }
    return json.dumps(document, indent=1, ensure_ascii=False) + "\n"
