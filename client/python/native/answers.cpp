#include "answers.h"

#include <pybind11/stl.h>

#include <cmath>
#include <vector>

#include "arrays.h"
#include "sensitivity.h"
#include "settings.h"

namespace marble::python {
namespace {

PyObject* fault_type = nullptr;

constexpr Status last(Status) { return Status::numerical_failure; }
constexpr Stationarity last(Stationarity) { return Stationarity::strong; }
constexpr SecondOrder last(SecondOrder) { return SecondOrder::convex; }
constexpr PointOrigin last(PointOrigin) { return PointOrigin::previous; }

// Reads a member of one of Python's enumerations, which have None in place of "unknown".
template <class Enum>
void read(const py::object& member, Enum& value) {
  const std::string text = member.is_none() ? "unknown" : member.attr("value").cast<std::string>();
  for (int i = 0; i <= static_cast<int>(last(Enum{})); ++i) {
    value = static_cast<Enum>(i);
    if (text == to_string(value)) return;
  }
  throw py::value_error("no such status: " + text);
}

py::tuple tuple_of(const Violations& v) {
  return py::make_tuple(v.equality, v.inequality, v.complementarity);
}

py::tuple tuple_of(const SparseMatrixView& matrix) {
  const auto integers = [](std::span<const Index> values) {
    py::list list;
    for (const Index value : values) list.append(value);
    return list;
  };
  return py::make_tuple(copied(matrix.values), integers(matrix.row_indices), integers(matrix.column_pointers),
                        matrix.rows);
}

}  // namespace

void make_fault(py::module_& module) {
  fault_type = PyErr_NewException("marble._core.Fault", PyExc_Exception, nullptr);
  module.attr("Fault") = py::reinterpret_borrow<py::object>(fault_type);
}

py::tuple fault_arguments(const Error& error) {
  return py::make_tuple(to_string(error.code), error.field, error.index, error.value, error.bound,
                        error.message());
}

void raise(const Error& error) {
  PyErr_SetObject(fault_type, fault_arguments(error).ptr());
  throw py::error_already_set();
}

std::optional<Solution> answer_of(const py::object& given) {
  if (given.is_none()) return {};
  const auto parts = given.cast<py::tuple>();
  Solution start;
  Borrowed arrays;
  std::size_t place = 0;
  for (std::vector<double>* const vector : {
#define MARBLE_POINT(letter, member, field) &start.member,
#include "marble/contract.def"
       }) {
    const std::span<const double> values = arrays.doubles(parts[place++]);
    vector->assign(values.begin(), values.end());
  }
  start.reference_objective = parts[place].cast<double>();
  return start;
}

std::vector<double> owned(const py::handle& values) {
  Borrowed arrays;
  const auto view = arrays.doubles(values);
  return {view.begin(), view.end()};
}

Numbers copied(std::span<const double> values) { return {{values.begin(), values.end()}}; }

py::dict dict_of(const ProblemView& view) {
  py::dict problem;
  problem["c0"] = view.c0;
#define MARBLE_VECTOR(letter, field) problem[#letter] = copied(view.letter);
#define MARBLE_MATRIX(letter, field, values, rows) problem[#letter] = tuple_of(view.letter);
#include "marble/contract.def"
  return problem;
}

py::object tuple_of(const std::optional<Conflict>& conflict) {
  if (!conflict) return py::none();
  const py::tuple parts = py::make_tuple(conflict->equalities, conflict->inequalities, conflict->left_sides,
                                         conflict->right_sides, conflict->complementarities);
  return py::make_tuple(parts, conflict->minimal, conflict->detail, conflict->linear_programs,
                        conflict->factorizations);
}

py::dict dict_of(Solution s, const Options& options, double total_s) {
  py::dict answer;
#define MARBLE_SOLUTION_NUMBER(name) answer[#name] = s.name;
#define MARBLE_SOLUTION_OPTIONAL(name) answer[#name] = s.name;
#define MARBLE_SOLUTION_TEXT(name) answer[#name] = s.name;
#define MARBLE_SOLUTION_VECTOR(name, field, letter) answer[#letter] = Numbers{std::move(s.name)};
#define MARBLE_SOLUTION_ENUM(name) answer[#name] = to_string(s.name);
#include "marble/solution.def"
  // Parts have forms of their own.
  answer["violations"] = tuple_of(s.violations);
  answer["options"] = dict_of(options);
  answer["conflict"] = tuple_of(s.conflict);
  answer["sensitivity"] = derivatives_reported(std::move(s.sensitivity));
  const Times& t = s.times;
  answer["times"] = py::make_tuple(0.0, t.setup_s, t.factorization_s, t.line_search_s, t.polish_s, t.solve_s,
                                   total_s, t.tree_s);
  return answer;
}

py::dict dict_of(const ProblemUpdate& update) {
  py::dict changes;
  if (update.c0) changes["c0"] = *update.c0;
#define MARBLE_VECTOR(letter, field) \
  if (!update.letter.empty()) changes[#letter] = copied(update.letter);
#define MARBLE_MATRIX(letter, field, values, rows) \
  if (!update.letter.empty()) changes[#letter] = copied(update.letter);
#include "marble/contract.def"
  return changes;
}

Solution solution_of(const py::object& answer) {
  Solution s;
#define MARBLE_SOLUTION_NUMBER(name) s.name = answer.attr(#name).cast<decltype(s.name)>();
#define MARBLE_SOLUTION_OPTIONAL(name) s.name = answer.attr(#name).cast<decltype(s.name)>();
#define MARBLE_SOLUTION_TEXT(name) s.name = answer.attr(#name).cast<std::string>();
#define MARBLE_SOLUTION_VECTOR(name, field, letter) s.name = owned(answer.attr(#letter));
#define MARBLE_SOLUTION_ENUM(name) read(answer.attr(#name), s.name);
#include "marble/solution.def"
  const py::object violations = answer.attr("violations");
  s.violations = {violations.attr("equality").cast<double>(), violations.attr("inequality").cast<double>(),
                  violations.attr("complementarity").cast<double>()};
  return s;
}

}  // namespace marble::python
