"""The reference of the client for Node, from what TypeDoc reads of its sources."""

import hashlib
import json
import pathlib
import re
import subprocess

ROOT = pathlib.Path(__file__).resolve().parents[2]
CLASS, INTERFACE, FUNCTION, ALIAS = 128, 256, 64, 2097152  # TypeDoc's kinds
PROPERTY, METHOD, CONSTRUCTOR, ACCESSOR = 1024, 2048, 512, 262144
NOT_BUILT = "TypeDoc was not run: the test typescript.build has not built the client"


def described(build, folder):
    """What TypeDoc says, from the last run if the sources are the same; None without the built client's TypeDoc."""
    client = build / "typescript/client/ts"
    if not (client / "node_modules/.bin/typedoc").exists() or not (client / "src/generated").is_dir():
        return None
    sources = sorted((client / "src").rglob("*.ts"))
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]
    made = folder / f"typedoc-{digest}.json"
    if not made.exists():
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("typedoc-*.json"):
            old.unlink()
        subprocess.run(["node_modules/.bin/typedoc", "--json", made, "--logLevel", "Warn"], cwd=client, check=True)
    return json.loads(made.read_text(encoding="utf-8"))


def type_text(of):
    """A type as TypeScript writes it."""
    kind = of["type"]
    if kind in ("intrinsic", "reference"):
        arguments = of.get("typeArguments")
        return of["name"] + (f"<{', '.join(map(type_text, arguments))}>" if arguments else "")
    if kind == "literal":
        return json.dumps(of["value"], ensure_ascii=False)
    if kind in ("union", "intersection"):
        return (" | " if kind == "union" else " & ").join(map(type_text, of["types"]))
    if kind == "array":
        inner = type_text(of["elementType"])
        return f"({inner})[]" if re.search(r" [|&] |^readonly |=>", inner) else f"{inner}[]"
    if kind == "typeOperator":
        return f"{of['operator']} {type_text(of['target'])}"
    if kind == "query":
        return f"typeof {type_text(of['queryType'])}"
    if kind == "indexedAccess":
        return f"{type_text(of['objectType'])}[{type_text(of['indexType'])}]"
    if kind == "tuple":
        return f"[{', '.join(map(type_text, of.get('elements', [])))}]"
    if kind == "namedTupleMember":
        return f"{of['name']}: {type_text(of['element'])}"
    if kind == "reflection":
        inner = of["declaration"]
        if "signatures" in inner:
            signature = inner["signatures"][0]
            return f"({parameters(signature)}) => {type_text(signature['type'])}"
        parts = [f"{part['name']}{optional(part)}: {type_text(type_of(part))}" for part in inner.get("children", [])]
        parts += [f"[{parameters(part)}]: {type_text(part['type'])}" for part in inner.get("indexSignatures", [])]
        return "{ " + "; ".join(parts) + " }"
    raise ValueError(f"TypeDoc's type {kind} is not known here")


def type_of(part):
    """Of a property, an accessor, or a method as a property."""
    if part["kind"] == ACCESSOR:
        return part["getSignature"]["type"]
    return part.get("type") or {"type": "reflection", "declaration": part}


def optional(part):
    return "?" if part["flags"].get("isOptional") or "defaultValue" in part else ""


def parameters(signature):
    return ", ".join(f"{'...' if part['flags'].get('isRest') else ''}{part['name']}{optional(part)}: {type_text(part['type'])}"
                     for part in signature.get("parameters", []))


def comment(part, words):
    """The summary, and what a tag says."""
    own = part.get("comment") or part.get("getSignature", {}).get("comment") or {}
    text = words("".join(piece["text"] for piece in own.get("summary", []) if not piece["text"].startswith("```")))
    for tag in own.get("blockTags", []):
        content = words("".join(piece["text"] for piece in tag["content"]))
        text += f" {'Throws' if tag['tag'] == '@throws' else 'See'}: {content}"
    return text.strip()


def examples(part):
    """The blocks of code in a comment."""
    pieces = part.get("comment", {}).get("summary", [])
    return "".join(piece["text"] + "\n\n" for piece in pieces if piece["text"].startswith("```"))


def signatures(part, words):
    """A function's or a method's, each as code with its meaning."""
    name = part["name"] if part["kind"] != CONSTRUCTOR else "constructor"
    text = ""
    for signature in part["signatures"]:
        returns = "" if part["kind"] == CONSTRUCTOR else f": {type_text(signature['type'])}"
        text += f"```ts\n{name}({parameters(signature)}){returns}\n```\n\n{comment(signature, words)}\n\n"
    return text


def members(part, words, table):
    """Properties as a table, then methods. What is inherited is at its class."""
    own = [member for member in part.get("children", []) if "inheritedFrom" not in member]
    fields = [member for member in own if member["kind"] in (PROPERTY, ACCESSOR)]
    text = ""
    if fields:
        rows = [[f"`{member['name']}{optional(member)}`", "`" + type_text(type_of(member)).replace("|", r"\|") + "`",
                 comment(member, words)] for member in fields]
        text += table(["property", "type", "meaning"], rows) + "\n"
    for member in own:
        if member["kind"] in (METHOD, CONSTRUCTOR):
            text += signatures(member, words)
    return text


def section(part, words, table):
    extended = [type_text(base) for base in part.get("extendedTypes", [])]
    text = f"## {part['name']}\n\n" + (f"Extends `{', '.join(extended)}`. " if extended else "") + comment(part, words) + "\n\n"
    text += examples(part)
    if part["kind"] == ALIAS:
        return text + f"```ts\ntype {part['name']} = {type_text(part['type'])}\n```\n\n"
    if part["kind"] == FUNCTION:
        return f"## {part['name']}\n\n" + signatures(part, words)
    return text + members(part, words, table)


def pages(build, folder, words, table, toctree):
    """A page per class, one of the functions, one of the errors, and one of the types."""
    head = "# TypeScript\n\n[The client for Node](../../../client/ts/README.md) explains the calls"
    found = described(build, folder)
    if found is None:
        print(NOT_BUILT, flush=True)
        return {"typescript/index.md": f"{head}.\n\n{NOT_BUILT}.\n"}
    parts = found["children"]
    errors = [part for part in parts if part["kind"] == CLASS and part["name"].endswith("Error")]
    classes = [part for part in parts if part["kind"] == CLASS and part not in errors]
    groups = {"functions": [part for part in parts if part["kind"] == FUNCTION], "errors": errors,
              "types": [part for part in parts if part["kind"] in (INTERFACE, ALIAS)]}
    made = {f"typescript/{name}.md": f"# {name.capitalize()}\n\n" + "".join(section(part, words, table) for part in group)
            for name, group in groups.items()}
    for part in classes:
        text = section(part, words, table).removeprefix("## ")
        made[f"typescript/{part['name']}.md"] = f"# {text}"
    rows = [[f"[{part['name']}]({part['name']}.md)", comment(part, words)] for part in classes]
    made["typescript/index.md"] = (
        f"{head}; this is the reference of each, by TypeDoc.\n\n" + table(["class", "meaning"], rows) + "\n"
        + toctree([*groups, *(part["name"] for part in classes)]))
    return made
