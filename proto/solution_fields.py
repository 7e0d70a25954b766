"""The fields of a solution, for proto/generate: the members of marble::Solution in core/include/marble/solution.h, each with
the field of marble.v1.Solution, which has the same name in lower case.
"""

import re
import textwrap

WIDTH = 120
CPP_TYPES = {"double": "double", "int32": "std::int32_t", "int64": "std::int64_t", "bool": "bool", "string": "std::string"}
PYTHON_TYPES = {"double": "float", "int32": "int", "int64": "int", "bool": "bool", "string": "str"}
INFINITY = "std::numeric_limits<double>::infinity()"
# Fields of the message that are no members: the calls return them beside the solution.
BESIDE = {"options", "coupled", "scenarios"}
MACROS = {"NUMBER": "name", "OPTIONAL": "name", "TEXT": "name", "VECTOR": "name, field, letter", "ENUM": "name",
          "PART": "name"}


class Field:
    """kind: one of MACROS; None if the types of member and field do not match. letter: its name in Python and C."""

    def __init__(self, member, cpp, initial, proto, doc, letter, is_enum):
        self.member, self.cpp, self.initial = member, cpp, initial
        self.proto, self.doc, self.letter = proto, doc, letter
        label, _, self.scalar = proto.rpartition(" ")
        self.is_infinite = label == "optional" and cpp == "double" and initial.lstrip("-") == INFINITY
        value = CPP_TYPES.get(self.scalar)
        if label == "optional":
            is_number = value != "std::string" and cpp == f"std::optional<{value}>"
            self.kind = "OPTIONAL" if self.is_infinite or is_number else None
        elif label == "repeated":
            self.kind = "VECTOR" if (self.scalar, cpp) == ("double", "std::vector<double>") else None
        elif value is not None:
            self.kind = None if cpp != value else "TEXT" if value == "std::string" else "NUMBER"
        else:
            self.kind = "PART" if not is_enum else "ENUM" if cpp == proto else None

    def row(self):
        arguments = f"{self.member}, {self.member.lower()}, {self.letter}" if self.kind == "VECTOR" else self.member
        return f"MARBLE_SOLUTION_{self.kind}({arguments})"

    def declaration(self):
        """In Python's dataclass; None if its type is a class, which marble.Solution declares itself."""
        if self.kind == "VECTOR":
            return f"{self.letter}: Vector"
        if self.is_infinite:
            return f"{self.letter}: float = {'-' if self.initial.startswith('-') else ''}math.inf"
        if self.kind == "OPTIONAL":
            return f"{self.letter}: {PYTHON_TYPES[self.scalar]} | None = None"
        return f"{self.letter}: {PYTHON_TYPES[self.scalar]}" if self.kind in ("NUMBER", "TEXT") else None

    def described(self):
        """In the docstring of Python's dataclass, where a default stands for an absent field."""
        doc = re.sub(r"\bSTATUS_([A-Z])", r"\1", self.doc)
        if self.kind == "OPTIONAL":
            default = self.declaration().rpartition(" ")[2].replace("math.", "")
            doc = re.sub(r"\b[Aa]bsent\b", default, doc)
        return "\n".join(textwrap.wrap(f"{self.letter}: {doc}", WIDTH - 4, initial_indent=" " * 4,
                                       subsequent_indent=" " * 4))


def members(header):
    """{"nodes": ("std::int64_t", "0"), …} of struct Solution, in its order; the value is that of a new one, or empty."""
    body = re.search(r"^struct Solution \{\n(.*?)^\};", header, re.MULTILINE | re.DOTALL)[1]
    declared = re.findall(r"^ *([\w:<>]+) (\w+)(?: = ([^;]+))?;", re.sub(r"//.*", "", body), re.MULTILINE)
    return {name: (kind, initial) for kind, name, initial in declared}


def fields_of(header, message, enumerations, letters):
    """message: {field: (type, comment), …}. letters: short names of members."""
    return [Field(member, cpp, initial, *message[member.lower()], letters.get(member, member),
                  message[member.lower()][0] in enumerations)
            for member, (cpp, initial) in members(header).items() if member.lower() in message]


def differences(header, message, fields):
    """Where the struct and the message do not have the same fields, or not of the same types."""
    known = {member.lower(): member for member in members(header)}
    for name in known.keys() - message.keys():
        yield f"Solution of solution.h has {known[name]}, which is no field of the message Solution"
    for name in message.keys() - known.keys() - BESIDE:
        yield f"the message Solution has {name}, which is no member of Solution in solution.h"
    for field in fields:
        if field.kind is None:
            yield (f"{field.member} is {field.cpp} in solution.h and {field.proto} in the message Solution: no kind of "
                   "solution.def has these types")


def definition(fields):
    macros = [f"MARBLE_SOLUTION_{kind}" for kind in MACROS]
    defaults = [f"#ifndef {macro}\n#define {macro}({arguments})\n#endif"
                for macro, arguments in zip(macros, MACROS.values(), strict=True)]
    return "\n".join([
        "// The fields of marble::Solution, in its order. Made by proto/generate from solution.h and solution.proto; not to be",
        "// edited. A file that includes it first defines the macros that it needs; all are undefined afterwards.",
        "//   NUMBER    a number or a flag",
        "//   OPTIONAL  one that may be unknown: it is absent in the message if it has the value of a new Solution",
        "//   TEXT      a string",
        "//   VECTOR    numbers; with the field of the message, and the letter that Python, C and Julia use",
        "//   ENUM      an enumeration; the message has one of the same name",
        "//   PART      a structure of its own",
        *defaults, "", *(field.row() for field in fields), "", *(f"#undef {macro}" for macro in macros)]) + "\n"


def python_class(fields):
    declared = [(field.described(), "    " + field.declaration()) for field in fields if field.declaration()]
    docs = "\n".join(doc for doc, _ in declared)
    declarations = "\n".join(declaration for _, declaration in declared)
    return f'''"""The numbers, flags, texts and vectors of a solution. Made by proto/generate from solution.proto; not to be edited."""

from __future__ import annotations

import math
from dataclasses import dataclass

from marble.model.lcqp import Vector


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SolutionFields:
    """The numbers, flags, texts and vectors of a solution.

{docs}
    """

{declarations}
'''
