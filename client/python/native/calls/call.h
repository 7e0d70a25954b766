// A solve of core's that Python asks for: what accompanies it, and how it runs.
#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>

#include "marble/options.h"
#include "marble/progress.h"
#include "marble/solver.h"
#include "sensitivity.h"

namespace marble::python {

/// Whether a solve under way shall end, which anybody may ask for; and what it is doing.
struct Stop {
  std::stop_source source;
  ActivityMonitor activity;
};

/// Calls Python's functions from a solve that runs without the GIL, from any of its threads. What one of them
/// raises ends the solve.
class Teller final : public ProgressSink {
 public:
  /// tell: None, or told of the rows, thinned out as a server does it.
  Teller(py::object tell, double interval_s, std::int32_t iterate_every, std::stop_source source);

  void report(const Progress& row) override;
  /// Runs it with the GIL, unless something was raised before.
  void call(const std::function<void()>& function);
  /// Where a row is wanted; else null.
  [[nodiscard]] ProgressSink* sink() { return tell_.is_none() ? nullptr : this; }
  void raise_if_raised();

 private:
  py::object tell_;
  double interval_s_;
  std::int32_t iterate_every_;
  std::stop_source source_;
  double last_s_ = -1.0;
  std::optional<py::error_already_set> raised_;
};

/// What accompanies one solve, from Python.
struct Call {
  std::optional<double> deadline_s;
  py::object tell;
  double interval_s;
  std::int32_t iterate_every;
  std::shared_ptr<Stop> stop;  // null where only Ctrl-C may ask for it
  bool main_thread;
  std::optional<Solution> warm_start;
  std::shared_ptr<const AskedDerivatives> derivatives;  // null where none are wanted
};

/// Whether Ctrl-C is to raise KeyboardInterrupt, and no handler of the program's own.
[[nodiscard]] bool raises_keyboard_interrupt();

/// By names and values that the package has checked by the contract; raises where one is out of its range.
[[nodiscard]] Options options_of(const py::dict& given);

using Solve =
    std::function<Expected<Solution>(const Options& options, const SolveControls& controls, Teller& teller)>;
/// What comes of a solve whose deadline passes: of one alone an error, of a session's its best point.
enum class Late { is_error, is_answer };
/// Runs it without the GIL; the answer as Python has it, but for a time limit that a deadline has set.
[[nodiscard]] py::dict run(const Options& options, const Call& call, const Solve& solve,
                           Late late = Late::is_error);

/// marble._core.Stop and Call.
void bind_calls(py::module_& module);

}  // namespace marble::python
