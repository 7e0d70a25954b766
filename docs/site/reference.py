"""The pages of docs/reference that are made of what describes itself: the programs' help, the contract, the OpenAPI
description, the Python package and the clients' sources.
"""

import hashlib
import importlib
import inspect
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import typescript
from google.protobuf import descriptor_pb2

ROOT = pathlib.Path(__file__).resolve().parents[2]
FLAG = re.compile(r"^  (-\S+|[A-Z]+)((?: \S+)*?)(?: {2,}|\n {20,})(\S.*)$", re.MULTILINE)
MODULES = {  # of the Python package, beside its classes and functions
    "aio": "Asyncio", "casadi": "CasADi", "cvxpy": "CVXPY", "pyomo": "Pyomo", "model.pyomo_disjunctions": "Disjunctions of Pyomo",
    "drake": "Drake",
    "nlp": "Nonlinear problems", "lcs": "Linear complementarity systems", "lcs.simulation": "Simulation in MuJoCo",
    "lcs.policy": "Gymnasium policies", "lcs.drake_system": "Drake systems", "lcs.drawing": "Drawings of plans",
    "lcs.time_stepping": "Time stepping", "lcs.mujoco": "MuJoCo models", "lcs.pinocchio": "Pinocchio models",
    "lcs.drake": "Drake plants", "robots": "Nonlinear robots", "hopper": "The hopper", "flights": "Rocket and gates",
    "drawing": "Pictures of the hopper", "layers": "Differentiable layers", "mat": "MATLAB files"}
PYOMO = {"pyomo": ["   :no-members:", "", ".. autofunction:: marble.pyomo.choose"],  # what their classes inherit is not here
         "model.pyomo_disjunctions": ["   :no-members:"]}
TYPES = {number: name.removeprefix("TYPE_").lower()
         for name, number in descriptor_pb2.FieldDescriptorProto.Type.items()}


def words(text):
    """Text without markup, in a line or a cell of a table. What is in backquotes is code."""
    parts = " ".join(text.split()).split("`")
    plain = [re.sub(r"([\\*|<>\[\]]|(?<!\w)_|_(?!\w))", r"\\\1", part) for part in parts[::2]]
    code = [f"`{part}`".replace("|", r"\|") for part in parts[1::2]]
    return "".join(part for pair in zip(plain, [*code, ""]) for part in pair)


def table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines) + "\n"


def toctree(names):
    return "\n".join(["```{toctree}", ":maxdepth: 1", "", *names, "```", ""])


def output(*command):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=True).stdout


def commands(build):
    """The program's help, a section a command."""
    marble = build / "bin/marble"
    whole = output(marble, "--help")
    text = f"# Commands of `marble`\n\n{words(whole.splitlines()[0])} [The program](../../client/cli/README.md) shows how to use it.\n\n"
    names = re.findall(r"^  (\w+) {2,}", whole.partition("Subcommands:")[2].partition("\n\n")[0], re.MULTILINE)
    text += words(whole.partition("\n\nExit codes")[2] and "Exit codes" + whole.partition("\n\nExit codes")[2]) + "\n\n"
    for name in names:
        shown = output(marble, name, "--help")
        about, usage, rest = re.match(r"(.*?)\nUsage: (.*?)\n(.*)", shown, re.DOTALL).groups()
        rows = [[f"`{flag}{argument}`", words(doc)] for flag, argument, doc in FLAG.findall(rest)]
        text += f"## {name}\n\n{words(about)}.\n\n```text\n{usage}\n```\n\n{table(['argument', 'meaning'], rows)}\n"
    return text


def settings(build):
    """Every setting of the server, from its help."""
    rows = []
    for flag, argument, doc in FLAG.findall(output(build / "bin/marble-server", "--help")):
        variable = re.search(r" \[(MARBLE_\w+)\]$", doc)
        if variable:
            bounds, default = re.search(r"in (\[.*?\])", argument), re.search(r"=(\S+)", argument)
            facts = [f"default {default[1]}" if default else "", f"in {bounds[1]}" if bounds else ""]
            rows.append([f"`{flag[2:].replace('-', '_')}`", words(doc[:variable.start()]) + "".join(
                f"<br>{words(fact)}" for fact in facts if fact)])
    return ("# Settings of the server\n\nThe setting `queue_jobs` is also the flag `--queue-jobs` and the environment variable "
            "`MARBLE_QUEUE_JOBS`. [Configuring the server](../../server/CONFIGURE.md) explains the file, the order of "
            "precedence and how to choose limits.\n\n" + table(["setting", "meaning"], rows))


def contract():
    """A page per .proto file: its services, messages and enumerations, with their comments."""
    with tempfile.TemporaryDirectory() as folder:
        made = pathlib.Path(folder) / "contract"
        names = sorted(path.relative_to(ROOT / "proto") for path in ROOT.glob("proto/marble/v1/*.proto"))
        output("protoc", "-I", ROOT / "proto", "--include_source_info", f"--descriptor_set_out={made}", *names)
        files = descriptor_pb2.FileDescriptorSet.FromString(made.read_bytes()).file
    pages = {}
    for file in files:
        comments = {tuple(place.path): place.leading_comments for place in file.source_code_info.location}
        text = ""
        for index, service in enumerate(file.service):
            text += f"(proto-{service.name})=\n## service {service.name}\n\n{described(comments[6, index])}\n\n"
            text += table(["method", "request", "response", "meaning"], [
                [f"`{method.name}`", ("stream " if method.client_streaming else "") + type_link(method.input_type),
                 ("stream " if method.server_streaming else "") + type_link(method.output_type),
                 words(comments.get((6, index, 2, at), ""))] for at, method in enumerate(service.method)]) + "\n"
        for index, message in enumerate(file.message_type):
            text += message_section(message, "", (4, index), comments)
        for index, enumeration in enumerate(file.enum_type):
            text += enumeration_section(enumeration, "", (5, index), comments)
        name = pathlib.Path(file.name).stem
        pages[f"proto/{name}.md"] = f"# {name}.proto\n\n{text}"
    pages["proto/index.md"] = (
        "# gRPC\n\nThe services and messages of `marble.v1`, from the files in [proto](../../../proto/README.md). "
        "Absent numbers are 0, absent messages and arrays are empty.\n\n"
        + toctree(sorted(pathlib.Path(name).stem for name in pages)))
    return pages


def described(comment):
    """A service's comment: paragraphs, and indented lines as they are."""
    lines = [line.removeprefix(" ") for line in comment.splitlines()]
    prose = " ".join(line for line in lines if not line.startswith("  "))
    block = "\n".join(line for line in lines if line.startswith("  "))
    return words(prose) + (f"\n\n```text\n{block}\n```" if block else "")


def type_link(name):
    name = name.removeprefix(".marble.v1.")
    return f"`{name.lstrip('.')}`" if name.startswith(".") else f"[{name}](#proto-{name.replace('.', '-')})"


def message_section(message, outer, path, comments):
    name = outer + message.name
    maps = {f".marble.v1.{name}.{inner.name}": inner for inner in message.nested_type if inner.options.map_entry}

    def kind(field):
        if field.type_name in maps:
            key, value = maps[field.type_name].field
            return f"map of {kind(key)} to {kind(value)}"
        plain = type_link(field.type_name) if field.type_name else TYPES[field.type]
        return ("repeated " if field.label == field.LABEL_REPEATED else "optional " if field.proto3_optional else "") + plain
    text = f"(proto-{name.replace('.', '-')})=\n## {name}\n\n{words(comments.get(path, ''))}\n\n"
    if message.field:
        text += table(["field", "type", "meaning"], [[f"`{field.name}`", kind(field), words(comments.get((*path, 2, at), ""))]
                                                     for at, field in enumerate(message.field)]) + "\n"
    for at, inner in enumerate(message.nested_type):
        if not inner.options.map_entry:
            text += message_section(inner, name + ".", (*path, 3, at), comments)
    for at, inner in enumerate(message.enum_type):
        text += enumeration_section(inner, name + ".", (*path, 4, at), comments)
    return text


def enumeration_section(enumeration, outer, path, comments):
    rows = [[f"`{value.name}`", str(value.number), words(comments.get((*path, 2, at), ""))]
            for at, value in enumerate(enumeration.value)]
    name = outer + enumeration.name
    return (f"(proto-{name.replace('.', '-')})=\n## {name}\n\n{words(comments.get(path, ''))}\n\n"
            + table(["value", "number", "meaning"], rows) + "\n")


def http():
    """The routes of the HTTP port, from its OpenAPI description."""
    api = json.loads((ROOT / "server/http/openapi.json").read_text(encoding="utf-8"))

    def resolved(part):
        while "$ref" in part:
            *_, group, name = part["$ref"].split("/")
            part = api["components"][group][name]
        return part
    text = ("# HTTP routes\n\n" + words(api["info"].get("description", "")) + "\n\n[Jobs over plain HTTP](../../server/HTTP.md) "
            "shows how to use them. The server has the description itself at `/openapi.json`.\n\n")
    for path, methods in api["paths"].items():
        for method, route in methods.items():
            if not isinstance(route, dict):
                continue
            text += f"## {method.upper()} {path}\n\n{words(route.get('summary', ''))}\n\n{words(route.get('description', ''))}\n\n"
            given = [resolved(part) for part in [*methods.get("parameters", []), *route.get("parameters", [])]]
            if given:
                text += table(["parameter", "in", "meaning"], [[f"`{part['name']}`", part["in"], words(part.get("description", ""))]
                                                              for part in given]) + "\n"
            text += table(["response", "meaning"], [[code, words(resolved(part).get("description", ""))]
                                                    for code, part in route["responses"].items()]) + "\n"
    return text


def members(name, thing):
    """Links to a class's methods and properties."""
    roles = {member: "attr" if isinstance(value, property) else "meth" for member, value in vars(thing).items()
             if not member.startswith("_") and (isinstance(value, property) or inspect.isroutine(value)) and value.__doc__}
    return ", ".join(f":py:{role}:`~{name}.{member}`" for member, role in roles.items()) + "\n"


def python(build):
    """A page per class of the package, one of its functions, one of its errors, and one per further module."""
    sys.path.insert(0, str(build / "python"))
    package = importlib.import_module("marble")

    def page(title, *directives):
        return "\n".join([title, "=" * len(title), "", *directives, ""])
    found = {name: getattr(package, name) for name in sorted(package.__all__, key=str.lower)}
    functions = [name for name, thing in found.items() if inspect.isfunction(thing)]
    classes = {name: thing for name, thing in found.items() if inspect.isclass(thing)}
    errors = [name for name, thing in classes.items() if issubclass(thing, BaseException)]
    others = [name for name in classes if name not in errors]
    pages = {f"python/{name}.rst": page(name, members(f"marble.{name}", classes[name]), f".. autoclass:: marble.{name}")
             for name in others}
    pages["python/functions.rst"] = page("Functions", *(f".. autofunction:: marble.{name}\n" for name in functions))
    pages["python/errors.rst"] = page("Errors", *(f".. autoexception:: marble.{name}\n   :show-inheritance:\n" for name in errors))
    for name, title in MODULES.items():
        pages[f"python/marble.{name}.rst"] = page(f"{title}: marble.{name}", f".. automodule:: marble.{name}", *PYOMO.get(name, []))
    rows = [[f"[{name}]({name}.rst)", words((thing.__doc__ or "").partition("\n\n")[0])] for name, thing in classes.items()
            if name in others]
    pages["python/index.md"] = (
        "# Python\n\n[The Python package](../../../client/python/README.md) explains the calls; this is the reference of "
        "each. Shapes, units, ranges and errors are in the texts of `help()`, too.\n\n"
        + table(["class", "meaning"], rows) + "\n" + toctree(["functions", "errors", *others])
        + "\n## Modules\n\n" + toctree([f"marble.{name}" for name in MODULES]))
    return pages


def c():
    """The C header, whose comments are its reference."""
    header = (ROOT / "client/c/include/marble.h").read_text(encoding="utf-8")
    return ("# C\n\n[Marble for C](../../client/c/README.md) explains the interface; this is its header `marble.h`.\n\n"
            f"```c\n{header}```\n")


def cpp(folder):
    """A page per header of the C++ library, from doxygen's XML in `folder`, which is made where it is older than they are."""
    values = {"PROJECT_SOURCE_DIR": str(ROOT), "CMAKE_BINARY_DIR": str(folder), "PROJECT_DESCRIPTION": "",
              "PROJECT_VERSION": (ROOT / "deploy/VERSION").read_text(encoding="utf-8").strip()}
    recipe = ROOT / "client/cpp/docs/Doxyfile.in"
    text = re.sub(r"@(\w+)@", lambda found: values[found[1]], recipe.read_text(encoding="utf-8"))
    text += f"\nOUTPUT_DIRECTORY = \"{folder}\"\nGENERATE_HTML = NO\nGENERATE_XML = YES\nXML_PROGRAMLISTING = NO\n"
    headers = {path.name: path for place in ("core/include/marble", "core/examples/include/marble", "client/cpp/include/marble")
               for path in sorted((ROOT / place).glob("*.h"))}
    made = folder / "xml/index.xml"
    read = [pathlib.Path(__file__), recipe, *headers.values(), *(path for header in headers.values() for path in header.parent.glob("*.def"))]
    if not made.exists() or max(path.stat().st_mtime for path in read) > made.stat().st_mtime:
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run(["doxygen", "-"], input=text, text=True, check=True)
        for path in folder.glob("xml/*.xml"):
            public = re.sub(r'<sectiondef kind="private-.*?</sectiondef>', "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
            public = re.sub(r'<memberdef kind="friend"[^>]*>\s*<type>class</type>.*?</memberdef>', "", public, flags=re.DOTALL)
            path.write_text(re.sub(r'<sectiondef kind="friend">\s*</sectiondef>', "", public), encoding="utf-8")
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in read)).hexdigest()[:12]  # Sphinx does not see the headers
    pages = {f"cpp/{name.removesuffix('.h')}.rst":
             f".. of {digest}\n\nmarble/{name}\n{'=' * 50}\n\n.. doxygenfile:: {name}\n" for name in headers}
    rows = [[f"[marble/{name}]({name.removesuffix('.h')}.rst)", words(first_comment(path))] for name, path in headers.items()]
    pages["cpp/index.md"] = (
        "# C++\n\n[Marble for C++](../../../client/cpp/README.md) explains the library; this is the reference of its headers. "
        "No call throws an exception.\n\n" + table(["header", "contents"], rows) + "\n"
        + toctree(name.removesuffix(".h") for name in headers))
    return pages


def first_comment(path):
    """The sentence at the top of a header."""
    lines = re.match(r"((?://.*\n)*)", path.read_text(encoding="utf-8"))[1]
    return re.split(r"\.(?:\s|$)|\n//\n", lines.replace("\n// ", " ").removeprefix("// "), maxsplit=1)[0] + "."


def pages(build, folder):
    return {**cpp(folder / "doxygen"), "commands.md": commands(build), "settings.md": settings(build), "http.md": http(),
            "c.md": c(), **contract(), **python(build), **typescript.pages(build, folder / "typedoc", words, table, toctree)}
