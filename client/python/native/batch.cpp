#include <optional>
#include <string>
#include <utility>

#include "answers.h"
#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "marble/batch_solver.h"

namespace marble::python {
namespace {

/// A pattern set up once, for marble.BatchSolver.
class Batches {
 public:
  Batches(const py::object& lcqp, const py::dict& given) {
    const Options options = options_of(given);
    Borrowed arrays;
    const Problem problem = value_or_raise(Problem::create(arrays.problem(lcqp)));
    std::optional<Expected<BatchSolver>> solver;
    {
      const py::gil_scoped_release no_gil;
      solver = or_out_of_memory([&] { return BatchSolver::create(problem, options); });
    }
    solver_.emplace(value_or_raise(std::move(*solver)));
  }

  /// given: arrays by the letters of the equation, "c0" and "z0"; their shapes were checked. start: None, or
  /// the dictionary that an earlier call with multipliers returned.
  py::dict solve(std::size_t count, const py::dict& given, int threads, bool multipliers,
                 const py::object& start, const std::shared_ptr<Stop>& stop, bool main_thread) {
    Borrowed arrays;
    const ProblemUpdate parts = arrays.update(given);  // the same letters, of all elements
    const auto values = [&](const char* name) {
      return given.contains(name) ? arrays.doubles(given[name]) : std::span<const double>();
    };
    const BatchNumbers numbers{.count = count,
                               .c0 = values("c0s"),
                               .g = parts.g,
                               .b = parts.b,
                               .d = parts.d,
                               .l = parts.l,
                               .r = parts.r,
                               .Q = parts.Q,
                               .A = parts.A,
                               .C = parts.C,
                               .L = parts.L,
                               .R = parts.R,
                               .initial_z = values("z0")};
    std::optional<BatchResult> first;
    if (!start.is_none()) first = result_of(start);
    std::stop_source source = stop->source;
    const BatchSolverControls controls{.threads = threads,
                                       .stop = source.get_token(),
                                       .multipliers = multipliers,
                                       .start = first ? &*first : nullptr};
    std::optional<Expected<BatchResult>> outcome;
    {
      std::optional<CtrlC> ctrl_c;
      if (main_thread && raises_keyboard_interrupt()) ctrl_c.emplace(source);
      const py::gil_scoped_release no_gil;
      outcome = solver_->solve(numbers, controls);
    }
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return dict_of(value_or_raise(std::move(*outcome)));
  }

  [[nodiscard]] std::int64_t memory_bytes() const { return solver_->memory_bytes(); }

 private:
  static py::dict dict_of(BatchResult r) {
    py::dict result;
    const py::object bytes = py::module_::import("builtins").attr("bytearray");
    const auto whole = [&](const auto& values) {  // a copy: these are few
      return bytes(py::memoryview::from_memory(values.data(),
                                               static_cast<py::ssize_t>(values.size() * sizeof(values[0]))));
    };
    std::vector<std::int32_t> codes;
    codes.reserve(r.count);
    for (const Status status : r.status) codes.push_back(static_cast<std::int32_t>(status));
    result["status"] = whole(codes);
    result["factorizations"] = whole(r.factorizations);
    result["z"] = Numbers{std::move(r.z)};
    result["objective"] = Numbers{std::move(r.objective)};
    result["violations"] = Numbers{std::move(r.violations)};
    result["kkt_residual"] = Numbers{std::move(r.kkt_residual)};
    result["y"] = Numbers{std::move(r.equality_multipliers)};
    result["nu"] = Numbers{std::move(r.inequality_multipliers)};
    result["xi"] = Numbers{std::move(r.complementarity_multipliers_L)};
    result["eta"] = Numbers{std::move(r.complementarity_multipliers_R)};
    result["solve_s"] = r.solve_s;
    return result;
  }

  /// start: (status codes, z, y, nu, xi, eta), with as many codes as elements.
  static BatchResult result_of(const py::object& start) {
    const auto given = start.cast<py::tuple>();
    BatchResult r;
    Borrowed arrays;
    for (const Index code : arrays.indices(given[0])) r.status.push_back(static_cast<Status>(code));
    r.count = r.status.size();
    r.z = owned(given[1]);
    r.equality_multipliers = owned(given[2]);
    r.inequality_multipliers = owned(given[3]);
    r.complementarity_multipliers_L = owned(given[4]);
    r.complementarity_multipliers_R = owned(given[5]);
    return r;
  }

  std::optional<BatchSolver> solver_;
};

}  // namespace

void bind_batches(py::module_& module) {
  py::list statuses;
  constexpr Status kStatuses[] = {
#define MARBLE_STATUS(name, ...) Status::name,
#include "marble/contract.def"
  };
  for (const Status status : kStatuses) statuses.append(to_string(status));
  module.attr("statuses") = statuses;
  module.attr("most_batch_elements") = most_batch_elements;
  py::class_<Batches>(module, "Batches")
      .def(py::init<const py::object&, const py::dict&>())
      .def("solve", &Batches::solve)
      .def_property_readonly("memory_bytes", &Batches::memory_bytes);
}

}  // namespace marble::python
