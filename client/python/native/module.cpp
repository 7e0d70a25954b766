// Provides marble._core: core's solvers for the Python package, which checks arguments and formats results.
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>
#include <string>

#include "answers.h"
#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "marble/composite/counter_random.h"
#include "marble/options.h"
#include "marble/solver.h"
#include "marble/version.h"
#include "marble/warm_solver.h"
#include "sensitivity.h"
#include "settings.h"

namespace marble::python {
namespace {

/// Solves a marble.LCQP once, from setup to solution.
py::dict solve(const py::object& lcqp, const py::dict& given, const Call& call) {
  const Options options = options_of(given);
  Borrowed arrays;
  const ProblemView view = arrays.problem(lcqp);
  const py::object z0 = lcqp.attr("z0");
  const std::span<const double> initial_z = z0.is_none() ? std::span<const double>() : arrays.doubles(z0);
  return run(options, call, [&](const Options& limited, SolveControls controls, Reporter&) {
    controls.initial_z = initial_z;
    return solve_in_process(view, limited, controls);
  });
}

/// A problem set up once and solved repeatedly: the basis of a session.
class Warm {
 public:
  Warm(const py::object& lcqp, const py::dict& given) : options_(options_of(given)) {
    Borrowed arrays;
    const Problem problem = value_or_raise(Problem::create(arrays.problem(lcqp)));
    const py::object z0 = lcqp.attr("z0");
    const std::span<const double> initial_z = z0.is_none() ? std::span<const double>() : arrays.doubles(z0);
    std::optional<Expected<WarmSolver>> solver;
    {
      const py::gil_scoped_release no_gil;
      solver = or_out_of_memory([&] { return WarmSolver::create(problem, options_, initial_z); });
    }
    solver_.emplace(value_or_raise(std::move(*solver)));
  }

  /// changes: new numbers by the letters of the equation, for a matrix its values. shift: for each of the
  /// four kinds of vectors its blocks (first, count, by).
  py::dict solve(const py::dict& given, const py::dict& changes, const py::object& z0, bool cold,
                 const py::object& shift, const Call& call) {
    const Wanted wanted(options_, given, changes, z0, cold, shift);
    auto answer = run(
        wanted.options, call,
        [&](const Options& limited, const SolveControls& controls, Reporter&) -> Expected<Solution> {
          MARBLE_RETURN_IF_ERROR(solver_->set_options(limited));
          return solver_->solve(wanted.update, wanted.restart, controls);
        },
        Late::is_answer);
    options_ = wanted.options;
    return answer;
  }

  /// The first part of a solve(), with the same arguments.
  void prepare(const py::dict& given, const py::dict& changes, const py::object& z0, bool cold,
               const py::object& shift) {
    const Wanted wanted(options_, given, changes, z0, cold, shift);
    Expected<void> prepared;
    {
      const py::gil_scoped_release no_gil;
      prepared = or_out_of_memory([&]() -> Expected<void> {
        MARBLE_RETURN_IF_ERROR(solver_->set_options(wanted.options));
        return solver_->prepare(wanted.update, wanted.restart);
      });
    }
    if (!prepared) raise(prepared.error());
    options_ = wanted.options;
  }

  [[nodiscard]] std::int64_t memory_bytes() const { return solver_->memory_bytes(); }
  [[nodiscard]] double setup_s() const { return solver_->setup_s(); }

 private:
  /// The content of an update; borrows its arrays.
  struct Wanted {
    Wanted(const Options& in_force, const py::dict& given, const py::dict& changes, const py::object& z0,
           bool cold, const py::object& shift)
        : options(in_force) {
      set_options(options, given);
      if (auto valid = validate(options); !valid) raise(valid.error());
      update = arrays.update(changes);
      restart.cold = cold;
      if (!z0.is_none()) restart.initial_z = arrays.doubles(z0);
      restart.shift = shift_of(shift);
    }
    Options options;
    Borrowed arrays;
    ProblemUpdate update;
    Restart restart;
  };

  Options options_;
  std::optional<WarmSolver> solver_;
};

/// Reads settings by their names; report: None, or called for each iteration.
nonlinear::Settings settings_of(const py::dict& given, const py::dict& lcqp, const py::object& report) {
  nonlinear::Settings settings;
  const auto method = nonlinear::method_of(given["nonlinear_method"].cast<std::string>());
  if (!method) raise(method.error());
  settings.method = *method;
  settings.curvature = curvature_of(given["curvature"].cast<std::string>());
  settings.step_tolerance = given["step_tolerance"].cast<double>();
  settings.feasibility_tolerance = given["feasibility_tolerance"].cast<double>();
  settings.radius = given["radius"].cast<double>();
  settings.largest_radius = std::max(settings.largest_radius, settings.radius);
  settings.iteration_limit = given["iteration_limit"].cast<std::int32_t>();
  settings.time_limit_s = given["time_limit_s"].cast<double>();
  set_options(settings.lcqp, lcqp);
  if (!report.is_none()) {
    settings.iteration = [&report](const nonlinear::Iteration& row) {
      report(row.iteration, row.objective, row.violation, row.step, row.radius, row.accepted, row.ticks);
    };
  }
  return settings;
}

/// Runs `solve(open)` such that Ctrl-C stops it. open: as in ticks_of, except that it first receives the
/// options of each LCQP.
template <class Solve>
auto run_nonlinear(nonlinear::Settings& settings, const py::object& open, bool main_thread,
                   const Solve& solve) {
  std::stop_source source;
  settings.stop = source.get_token();
  std::optional<CtrlC> ctrl_c;
  if (main_thread && open.is_none() && raises_keyboard_interrupt()) ctrl_c.emplace(source);
  auto outcome = solve(with_options(open, settings.lcqp));
  ctrl_c.reset();
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  return value_or_raise(std::move(outcome));
}

py::dict dict_of_answer(nonlinear::Answer a) {
  py::dict answer;
  answer["status"] = to_string(a.status);
  answer["detail"] = a.detail;
  answer["x"] = Numbers{std::move(a.x)};
  answer["y"] = Numbers{std::move(a.multipliers.equalities)};
  answer["nu"] = Numbers{std::move(a.multipliers.inequalities)};
  answer["xi"] = Numbers{std::move(a.multipliers.G)};
  answer["eta"] = Numbers{std::move(a.multipliers.H)};
  answer["bounds"] = Numbers{std::move(a.multipliers.bounds)};
  answer["objective"] = a.objective;
  answer["violation"] = a.violation;
  answer["kkt_residual"] = a.kkt_residual;
  answer["b_stationary"] = a.b_stationary ? py::object(py::bool_(*a.b_stationary)) : py::object(py::none());
  answer["iterations"] = a.iterations;
  answer["ticks"] = a.ticks;
  answer["evaluations"] = a.evaluations;
  answer["factorizations"] = a.factorizations;
  answer["reopened"] = a.reopened;
  return answer;
}

/// Solves a marble.nlp problem.
py::dict solve_nonlinear_problem(const py::dict& problem, const py::dict& given, const py::dict& lcqp,
                                 const py::object& report, const py::object& open, bool main_thread) {
  nonlinear::Settings settings = settings_of(given, lcqp, report);
  return dict_of_answer(run_nonlinear(settings, open, main_thread, [&](const py::object& opens) {
    return solve_nonlinear(problem, settings, opens);
  }));
}

/// Solves sample-average stages one after the other. growing: the other settings by their names;
/// report_level: called for each.
py::dict solve_retrospective_problem(const py::dict& problem, const py::dict& given, const py::dict& lcqp,
                                     const py::object& report, const py::object& open, bool main_thread,
                                     const py::dict& growing, const py::object& use_samples,
                                     const py::object& sample_cost, const py::object& report_level) {
  nonlinear::RetrospectiveSettings settings;
  settings.loop = settings_of(given, lcqp, report);
  settings.first_samples = growing["first_samples"].cast<std::int64_t>();
  settings.growth = growing["growth"].cast<double>();
  settings.levels = growing["levels"].cast<std::int32_t>();
  settings.largest_samples = growing["largest_samples"].cast<std::int64_t>();
  const auto test = growing["test"].cast<std::string>();
  if (test != "merit" && test != "step") raise(invalid("test", test, "must be merit or step"));
  settings.test = test == "merit" ? nonlinear::LevelTest::merit : nonlinear::LevelTest::step;
  if (!growing["reduction"].is_none()) settings.reduction = growing["reduction"].cast<double>();
  settings.tolerance = growing["tolerance"].cast<double>();
  settings.carry_curvature = growing["carry_curvature"].cast<bool>();
  settings.fresh_samples = growing["fresh_samples"].cast<std::int64_t>();
  settings.level = [&report_level](const nonlinear::Level& l) {
    py::dict row;
    row["level"] = l.level, row["samples"] = l.samples, row["status"] = to_string(l.status);
    row["objective"] = l.objective, row["violation"] = l.violation, row["kkt_residual"] = l.kkt_residual;
    row["iterations"] = l.iterations, row["ticks"] = l.ticks, row["evaluations"] = l.evaluations;
    row["linearisations"] = l.linearisations, row["estimate"] = py::none();
    if (l.estimate) row["estimate"] = py::make_tuple(l.estimate->mean, l.estimate->half_width);
    row["x"] = Numbers{{l.x.begin(), l.x.end()}};
    report_level(row);
  };
  auto outcome = run_nonlinear(settings.loop, open, main_thread, [&](const py::object& opens) {
    return solve_retrospective(problem, settings, use_samples, sample_cost, opens);
  });
  return dict_of_answer(std::move(outcome.answer));
}

/// Returns the numbers sample by sample.
Numbers uniform_numbers(std::uint64_t seed, std::uint64_t first, std::uint64_t count, std::uint32_t numbers) {
  const CounterRandom random(seed);
  Numbers made;
  made.values.reserve(count * numbers);
  for (std::uint64_t sample = first; sample < first + count; ++sample)
    for (std::uint32_t k = 0; k < numbers; ++k) made.values.push_back(random.uniform(sample, k));
  return made;
}

}  // namespace

PYBIND11_MODULE(_core, m) {
  make_fault(m);
  m.attr("version") = MARBLE_VERSION;
  py::class_<Numbers>(m, "Numbers", py::buffer_protocol()).def_buffer([](Numbers& numbers) {
    return py::buffer_info(numbers.values.data(), static_cast<py::ssize_t>(numbers.values.size()));
  });
  bind_calls(m);
  m.def("solve", &solve);
  m.def("solve_nonlinear", &solve_nonlinear_problem);
  m.def("solve_retrospective", &solve_retrospective_problem);
  m.def("uniform", &uniform_numbers);
  py::class_<Warm>(m, "Warm")
      .def(py::init<const py::object&, const py::dict&>())
      .def("solve", &Warm::solve)
      .def("prepare", &Warm::prepare)
      .def_property_readonly("memory_bytes", &Warm::memory_bytes)
      .def_property_readonly("setup_s", &Warm::setup_s);
  bind_real_time(m);
  bind_sensitivity(m);
  bind_scenarios(m);
  bind_coupled(m);
  bind_lcs(m);
  bind_batches(m);
}

}  // namespace marble::python
