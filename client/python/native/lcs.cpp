#include "marble/lcs.h"

#include <optional>
#include <string>
#include <utility>

#include "answers.h"
#include "arrays.h"
#include "bindings.h"
#include "call.h"

namespace marble::python {
namespace {

/// Views a marble.lcs.LCS.
LcsView view_of(const py::handle& lcs, Borrowed& arrays) {
  const auto values = [&](const char* name) { return arrays.doubles(lcs.attr(name)); };
  return {lcs.attr("nx").cast<Index>(),
          lcs.attr("nu").cast<Index>(),
          lcs.attr("nl").cast<Index>(),
          values("A"),
          values("B"),
          values("D"),
          values("d"),
          values("E"),
          values("F"),
          values("H"),
          values("c")};
}

/// Reads a task by the names of its parts; absent ones are None.
LcsTask task_of(const py::dict& given) {
  const auto values = [&](const char* name) {
    const py::object value = given[name];
    return value.is_none() ? std::vector<double>() : owned(value);
  };
  return {.stages = given["stages"].cast<Index>(),
          .Q = values("Q"),
          .R = values("R"),
          .P = values("P"),
          .R_change = values("R_change"),
          .regularization = given["regularization"].cast<double>(),
          .x_ref = values("x_ref"),
          .u_ref = values("u_ref"),
          .x_lb = values("x_lb"),
          .x_ub = values("x_ub"),
          .u_lb = values("u_lb"),
          .u_ub = values("u_ub"),
          .max_u_change = values("max_u_change")};
}

Status status_of(const std::string& name) {
  for (const Status status : {
#define MARBLE_STATUS(name, ...) Status::name,
#include "marble/contract.def"
       }) {
    if (name == to_string(status)) return status;
  }
  throw py::value_error("no such status: " + name);
}

class Planner {
 public:
  Planner(const py::object& lcs, const py::dict& task, const py::dict& options) {
    Borrowed arrays;
    planner_.emplace(
        value_or_raise(LcsPlanner::create(view_of(lcs, arrays), task_of(task), options_of(options))));
  }

  [[nodiscard]] py::dict problem() const { return dict_of(planner_->problem()); }
  [[nodiscard]] Numbers terminal_cost() const { return copied(planner_->terminal_cost()); }

  /// Returns the changed numbers by the letters of the equation, the start or None, and the stages by which
  /// the last solution moves on. lcs: None: as before. Vectors may be None.
  py::tuple begin(const py::object& lcs, const py::object& x0, const py::object& x_ref,
                  const py::object& u_ref, const py::object& last_u, const py::object& u, Index shift,
                  bool prepares, const py::object& x_lb, const py::object& x_ub, const py::object& u_lb,
                  const py::object& u_ub) {
    Borrowed arrays;
    std::optional<LcsView> view;
    if (!lcs.is_none()) view = view_of(lcs, arrays);
    const auto values = [&](const py::object& given) {
      return given.is_none() ? std::span<const double>() : arrays.doubles(given);
    };
    const LcsStep step = {.x0 = values(x0),
                          .lcs = view ? &*view : nullptr,
                          .x_ref = values(x_ref),
                          .u_ref = values(u_ref),
                          .last_u = values(last_u),
                          .u = values(u),
                          .shift = shift,
                          .x_lb = values(x_lb),
                          .x_ub = values(x_ub),
                          .u_lb = values(u_lb),
                          .u_ub = values(u_ub)};
    const LcsUpdate update = value_or_raise(prepares ? planner_->prepare(step) : planner_->begin(step));
    const py::object start =
        update.restart.initial_z.empty() ? py::none() : py::cast(copied(update.restart.initial_z));
    return py::make_tuple(dict_of(update.numbers), start, update.restart.shift.variables.empty() ? 0 : shift);
  }

  /// z: None if there is no solution.
  py::dict finish(const std::string& status, const py::object& z, const std::string& detail) {
    Borrowed arrays;
    LcsPlan p =
        value_or_raise(planner_->finish({.status = status_of(status),
                                         .z = z.is_none() ? std::span<const double>() : arrays.doubles(z),
                                         .detail = detail}));
    py::dict plan;
    plan["x"] = Numbers{std::move(p.x)};
    plan["u"] = Numbers{std::move(p.u)};
    plan["lam"] = Numbers{std::move(p.lam)};
    plan["objective"] = p.objective;
    plan["status"] = to_string(p.status);
    plan["origin"] = to_string(p.origin);
    plan["feasible"] = p.feasible;
    plan["violations"] =
        py::make_tuple(p.violations.equality, p.violations.inequality, p.violations.complementarity);
    plan["start_objective"] = p.start_objective;
    plan["detail"] = p.detail;
    plan["assembly_s"] = p.assembly_s;
    plan["rollout_s"] = p.rollout_s;
    return plan;
  }

  void resend() { planner_->resend(); }

 private:
  std::optional<LcsPlanner> planner_;
};

/// Returns x and λ of all stages.
py::tuple roll_out(const py::object& lcs, const py::object& x0, const py::object& u) {
  Borrowed arrays;
  const LCS system = value_or_raise(LCS::create(view_of(lcs, arrays)));
  LcsTrajectory made = value_or_raise(rollout(system, arrays.doubles(x0), arrays.doubles(u)));
  return py::make_tuple(Numbers{std::move(made.x)}, Numbers{std::move(made.lam)});
}

}  // namespace

void bind_lcs(py::module_& module) {
  py::class_<Planner>(module, "LcsPlanner")
      .def(py::init<const py::object&, const py::dict&, const py::dict&>())
      .def("problem", &Planner::problem)
      .def("terminal_cost", &Planner::terminal_cost)
      .def("begin", &Planner::begin)
      .def("finish", &Planner::finish)
      .def("resend", &Planner::resend);
  module.def("lcs_rollout", &roll_out);
}

}  // namespace marble::python
