// Runs core's solves for Python: their controls and their execution.
#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <csignal>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "marble/options.h"
#include "marble/progress.h"
#include "marble/solver.h"
#include "sensitivity.h"

namespace marble::python {

// Handles Ctrl-C while the solver runs on Python's main thread.

/// During its lifetime SIGINT also requests a stop; Python's own handler then decides the consequence. Python
/// itself would process the signal only after the solve. For the main thread; nested ones stop together.
class CtrlC {
 public:
  explicit CtrlC(std::stop_source& source);
  CtrlC(const CtrlC&) = delete;
  CtrlC& operator=(const CtrlC&) = delete;
  ~CtrlC();

 private:
  static void on_signal(int signal);

  std::stop_source& source_;
  CtrlC* below_;
  struct sigaction previous_ = {};
  bool installed_ = false;
};

/// A stop request that any thread may make to a running solve, and the solve's current activity.
struct Stop {
  std::stop_source source;
  ActivityMonitor activity;
};

/// Calls Python functions from a solve that runs without the GIL, from any of its threads. An exception in
/// one of them ends the solve.
class Reporter final : public ProgressSink {
 public:
  /// report: None, or a function for the rows, thinned out as a server does.
  Reporter(py::object report, double interval_s, std::int32_t iterate_every, std::stop_source source);

  void report(const Progress& row) override;
  /// Runs it with the GIL, unless an exception was raised before.
  void call(const std::function<void()>& function);
  /// Returns null if no rows are requested.
  [[nodiscard]] ProgressSink* sink() { return report_.is_none() ? nullptr : this; }
  void raise_if_raised();

 private:
  py::object report_;
  double interval_s_;
  std::int32_t iterate_every_;
  std::stop_source source_;
  double last_s_ = -1.0;
  std::optional<py::error_already_set> raised_;
};

/// Controls of one solve, from Python.
struct Call {
  std::optional<double> deadline_s;
  py::object report;
  double interval_s;
  std::int32_t iterate_every;
  std::shared_ptr<Stop> stop;  // null if only Ctrl-C may stop it
  bool main_thread;
  std::optional<Solution> warm_start;
  std::shared_ptr<const AskedDerivatives> derivatives;  // null if none are requested
};

/// True if Ctrl-C raises KeyboardInterrupt, i.e. the program has no handler of its own.
[[nodiscard]] bool raises_keyboard_interrupt();

/// Reads names and values that the package has checked against the contract; raises if a value is out of
/// range.
[[nodiscard]] Options options_of(const py::dict& given);

using Solve = std::function<Expected<Solution>(const Options& options, const SolveControls& controls,
                                               Reporter& reporter)>;
/// The result of a solve whose deadline passes: an error for a single solve, the best point for a session's.
enum class Late { is_error, is_answer };
/// Runs the solve without the GIL; returns the solution as Python expects it, with the original time limit if
/// a deadline has replaced it.
[[nodiscard]] py::dict run(const Options& options, const Call& call, const Solve& solve,
                           Late late = Late::is_error);

/// Binds marble._core.Stop and Call.
void bind_calls(py::module_& module);

}  // namespace marble::python
