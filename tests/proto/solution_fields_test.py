"""The generator of the fields of solutions: what a member and its field become, and which differences it reports.

Usage: solution_fields_test.py ROOT
"""

import pathlib
import sys
import unittest

sys.dont_write_bytecode = True
ROOT = pathlib.Path(sys.argv[1])
sys.path.insert(0, str(ROOT / "proto"))
import solution_fields  # noqa: E402

# A struct of one member, its field, the row of the table and the declaration in Python.
KINDS = {
    "a number": ("std::int64_t nodes = 0;", "int64", "NUMBER(nodes)", "nodes: int"),
    "a flag": ("bool proved = false;", "bool", "NUMBER(proved)", "proved: bool"),
    "a text": ("std::string detail;", "string", "TEXT(detail)", "detail: str"),
    "numbers": ("std::vector<double> certificate;", "repeated double", "VECTOR(certificate, certificate, certificate)",
                "certificate: Vector"),
    "numbers with a letter": ("std::vector<double> multipliers_L;", "repeated double",
                              "VECTOR(multipliers_L, multipliers_l, xi)", "xi: Vector"),
    "a flag that may be unknown": ("std::optional<bool> b_stationary;", "optional bool", "OPTIONAL(b_stationary)",
                                   "b_stationary: bool | None = None"),
    "a number that is -infinity if it is unknown": (
        "double bound = -std::numeric_limits<double>::infinity();", "optional double", "OPTIONAL(bound)",
        "bound: float = -math.inf"),
    "a number that is infinity if it is unknown": (
        "double gap = std::numeric_limits<double>::infinity();", "optional double", "OPTIONAL(gap)",
        "gap: float = math.inf"),
    "an enumeration": ("Status status = Status::solved;", "Status", "ENUM(status)", None),
    "a structure": ("std::optional<Conflict> conflict;", "Conflict", "PART(conflict)", None),
}


def read(member, proto, doc="What it means."):
    header = f"/// A solution.\nstruct Solution {{\n  {member}  ///< what it means; in short\n}};\n"
    name = next(iter(solution_fields.members(header)))
    message = {name.lower(): (proto, doc)}
    return header, message, solution_fields.fields_of(header, message, {"Status"}, {"multipliers_L": "xi"})


class SolutionFields(unittest.TestCase):
    def test_each_kind_has_its_row_and_its_declaration_in_python(self):
        for what, (member, proto, row, declaration) in KINDS.items():
            with self.subTest(what):
                header, message, [field] = read(member, proto)
                self.assertEqual(list(solution_fields.differences(header, message, [field])), [])
                self.assertIn(f"\nMARBLE_SOLUTION_{row}\n", solution_fields.definition([field]))
                self.assertEqual(field.declaration(), declaration)

    def test_python_s_comment_names_what_stands_for_an_absent_field(self):
        for what, default in (("a flag that may be unknown", "None"),
                              ("a number that is -infinity if it is unknown", "-inf")):
            member, proto, _, _ = KINDS[what]
            *_, [field] = read(member, proto, "A number. Absent if STATUS_SOLVED, absent else.")
            self.assertEqual(field.described().partition(": ")[2], f"A number. {default} if SOLVED, {default} else.")

    def test_types_that_do_not_match_are_reported(self):
        for member, proto in (("double nodes = 0.0;", "int64"), ("std::int32_t nodes = 0;", "int64"),
                              ("double gap = 0.0;", "optional double"), ("std::optional<std::string> detail;", "optional string"),
                              ("std::vector<int> rows;", "repeated int32"), ("bool status = false;", "Status")):
            header, message, fields = read(member, proto)
            [reported] = solution_fields.differences(header, message, fields)
            self.assertRegex(reported, f"is .* in solution.h and {proto} in the message Solution: no kind")

    def test_a_member_without_a_field_and_a_field_without_a_member_are_reported(self):
        header, message, _ = read("bool proved = false;", "bool")
        self.assertEqual(list(solution_fields.differences(header, {}, [])),
                         ["Solution of solution.h has proved, which is no field of the message Solution"])
        message["example_count"] = ("int64", "")
        message["options"] = ("SolveOptions", "")
        self.assertEqual(list(solution_fields.differences(header, message, [])),
                         ["the message Solution has example_count, which is no member of Solution in solution.h"])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
