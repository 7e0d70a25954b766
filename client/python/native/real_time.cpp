#include "marble/real_time.h"

#include <pybind11/stl.h>

#include <optional>
#include <string>
#include <utility>

#include "answers.h"
#include "arrays.h"
#include "bindings.h"
#include "settings.h"

namespace marble::python {
namespace {

/// problem and open are as in bindings.h.
class RealTimeLoop {
 public:
  RealTimeLoop(const py::dict& problem, const py::dict& given, const py::dict& lcqp, const py::object& open) {
    nonlinear::RealTimeSettings settings;
    settings.curvature = curvature_of(given["curvature"].cast<std::string>());
    settings.diagonal = given["diagonal"].cast<double>();
    settings.radius = given["radius"].cast<double>();
    const auto fallback = given["fallback"].cast<std::string>();
    using nonlinear::Fallback;
    settings.fallback = fallback == "keep" ? Fallback::keep : Fallback::shifted;
    if (fallback == "elastic") settings.fallback = Fallback::elastic;
    if (settings.fallback == Fallback::shifted && fallback != "shifted")
      raise(invalid("fallback", fallback, "must be keep, shifted or elastic"));
    settings.shift = shift_of(given["shift"]);
    set_options(settings.lcqp, lcqp);
    nonlinear::Measured measured;
    for (const py::handle& j : given["variables"]) measured.variables.push_back(j.cast<Index>());
    for (const py::handle& i : given["equalities"]) measured.equalities.push_back(i.cast<Index>());
    loop_.emplace(value_or_raise(nonlinear::RealTime::create(
        problem_of(problem), measured, ticks_of(with_options(open, settings.lcqp)), settings)));
  }

  void prepare() {
    if (auto prepared = loop_->prepare(); !prepared) raise(prepared.error());
  }
  py::dict feedback(const py::object& measurement, double deadline_s) {
    Borrowed arrays;
    nonlinear::RealTimeTick t = value_or_raise(loop_->feedback(arrays.doubles(measurement), deadline_s));
    py::dict tick;
    tick["outcome"] = to_string(t.outcome);
    tick["x"] = Numbers{std::move(t.x)};
    tick["y"] = Numbers{std::move(t.multipliers.equalities)};
    tick["nu"] = Numbers{std::move(t.multipliers.inequalities)};
    tick["xi"] = Numbers{std::move(t.multipliers.G)};
    tick["eta"] = Numbers{std::move(t.multipliers.H)};
    tick["status"] = to_string(t.status);
    tick["deadline_met"] = t.deadline_met;
    tick["why"] = t.why;
    tick["step"] = t.step, tick["violation"] = t.violation;
    tick["b_stationary"] = t.b_stationary;
    tick["ticks"] = t.ticks, tick["factorizations"] = t.factorizations;
    tick["reopened"] = t.reopened;
    return tick;
  }
  void restart(const py::object& x) {
    Borrowed arrays;
    if (auto begun = loop_->restart(arrays.doubles(x)); !begun) raise(begun.error());
  }

 private:
  std::optional<nonlinear::RealTime> loop_;
};

}  // namespace

void bind_real_time(py::module_& m) {
  py::class_<RealTimeLoop>(m, "RealTimeLoop")
      .def(py::init<const py::dict&, const py::dict&, const py::dict&, const py::object&>())
      .def("prepare", &RealTimeLoop::prepare)
      .def("feedback", &RealTimeLoop::feedback)
      .def("restart", &RealTimeLoop::restart);
}

}  // namespace marble::python
