#include "answers.h"

#include <pybind11/stl.h>

#include <cmath>
#include <initializer_list>
#include <vector>

#include "arrays.h"
#include "sensitivity.h"
#include "settings.h"

namespace marble::python {
namespace {

PyObject* fault_type = nullptr;

template <class Enum>
Enum named(const py::handle& name, std::initializer_list<Enum> all) {
  const auto text = name.cast<std::string>();
  for (const Enum value : all) {
    if (text == to_string(value)) return value;
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
  std::vector<double>* const vectors[] = {&start.z, &start.equality_multipliers,
                                          &start.inequality_multipliers, &start.complementarity_multipliers_L,
                                          &start.complementarity_multipliers_R};
  Borrowed arrays;
  std::size_t place = 0;
  for (std::vector<double>* const vector : vectors) {
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
  answer["status"] = to_string(s.status);
  answer["detail"] = s.detail;
  answer["z"] = Numbers{std::move(s.z)};
  answer["y"] = Numbers{std::move(s.equality_multipliers)};
  answer["nu"] = Numbers{std::move(s.inequality_multipliers)};
  answer["xi"] = Numbers{std::move(s.complementarity_multipliers_L)};
  answer["eta"] = Numbers{std::move(s.complementarity_multipliers_R)};
  answer["certificate"] = Numbers{std::move(s.certificate)};
  answer["objective"] = s.objective;
  answer["violations"] = tuple_of(s.violations);
  answer["kkt_residual"] = s.kkt_residual;
  answer["origin"] = to_string(s.origin);
  answer["stationarity"] = to_string(s.stationarity);
  answer["b_stationary"] = s.b_stationary ? py::object(py::bool_(*s.b_stationary)) : py::object(py::none());
  answer["second_order"] = to_string(s.second_order);
  answer["proved"] = s.proved;
  answer["bound"] = s.bound;
  answer["gap"] = s.gap;
  answer["nodes"] = s.nodes;
  answer["open_nodes"] = s.open_nodes;
  answer["reused_nodes"] = s.reused_nodes;
  answer["iterations"] = s.iterations;
  answer["factorizations"] = s.factorizations;
  answer["reference_objective"] = s.reference_objective;
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
  const auto word = [&answer](const char* name) {
    const py::object kind = answer.attr(name);
    return kind.is_none() ? py::object(py::str("unknown")) : py::object(kind.attr("value"));
  };
  Solution s;
  s.status = named<Status>(word("status"), {
#define MARBLE_STATUS(name, ...) Status::name,
#include "marble/contract.def"
                                           });
  s.detail = answer.attr("detail").cast<std::string>();
  s.z = owned(answer.attr("z")), s.equality_multipliers = owned(answer.attr("y"));
  s.inequality_multipliers = owned(answer.attr("nu"));
  s.complementarity_multipliers_L = owned(answer.attr("xi"));
  s.complementarity_multipliers_R = owned(answer.attr("eta"));
  s.certificate = owned(answer.attr("certificate"));
  s.objective = answer.attr("objective").cast<double>();
  const py::object violations = answer.attr("violations");
  s.violations = {violations.attr("equality").cast<double>(), violations.attr("inequality").cast<double>(),
                  violations.attr("complementarity").cast<double>()};
  s.kkt_residual = answer.attr("kkt_residual").cast<double>();
  if (const py::object b = answer.attr("b_stationary"); !b.is_none()) s.b_stationary = b.cast<bool>();
  s.stationarity = named<Stationarity>(word("stationarity"),
                                       {Stationarity::unknown, Stationarity::weak, Stationarity::clarke,
                                        Stationarity::mordukhovich, Stationarity::strong});
  s.second_order = named<SecondOrder>(word("second_order"),
                                      {SecondOrder::unknown, SecondOrder::saddle, SecondOrder::necessary,
                                       SecondOrder::minimum, SecondOrder::convex});
  s.proved = answer.attr("proved").cast<bool>();
  s.bound = answer.attr("bound").cast<double>();
  s.iterations = answer.attr("iterations").cast<decltype(s.iterations)>();
  s.factorizations = answer.attr("factorizations").cast<decltype(s.factorizations)>();
  s.reference_objective = answer.attr("reference_objective").cast<double>();
  return s;
}

}  // namespace marble::python
