#include "call.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <limits>
#include <utility>
#include <vector>

#include "answers.h"
#include "settings.h"

namespace marble::python {
namespace {

// The newest living one, for the handler.
std::atomic<CtrlC*> newest = nullptr;
static_assert(std::atomic<CtrlC*>::is_always_lock_free);

}  // namespace

CtrlC::CtrlC(std::stop_source& source) : source_(source), below_(newest.load()) {
  sigaction(SIGINT, nullptr, &previous_);
  if ((previous_.sa_flags & SA_SIGINFO) != 0) return;  // not Python's handler
  installed_ = true;
  newest = this;
  struct sigaction action = previous_;
  action.sa_handler = on_signal;
  sigaction(SIGINT, &action, nullptr);
}

CtrlC::~CtrlC() {
  if (!installed_) return;
  struct sigaction current = {};
  sigaction(SIGINT, nullptr, &current);
  // Another handler set meanwhile is kept.
  if ((current.sa_flags & SA_SIGINFO) == 0 && current.sa_handler == on_signal)
    sigaction(SIGINT, &previous_, nullptr);
  newest = below_;
}

// These sources have no callbacks, so a request is only a store into an atomic.
void CtrlC::on_signal(int signal) {
  CtrlC* oldest = nullptr;
  for (CtrlC* one = newest; one != nullptr; one = one->below_) {
    one->source_.request_stop();
    oldest = one;
  }
  if (oldest != nullptr) oldest->previous_.sa_handler(signal);
}

namespace {

using Clock = std::chrono::steady_clock;

py::tuple tuple_of(const Violations& v) {
  return py::make_tuple(v.equality, v.inequality, v.complementarity);
}

}  // namespace

Reporter::Reporter(py::object report, double interval_s, std::int32_t iterate_every, std::stop_source source)
    : report_(std::move(report)),
      interval_s_(interval_s),
      iterate_every_(iterate_every),
      source_(std::move(source)) {}

void Reporter::report(const Progress& row) {
  if (last_s_ >= 0.0 && row.elapsed_s - last_s_ < interval_s_) return;
  last_s_ = row.elapsed_s;
  call([&] {
    const bool whole = iterate_every_ > 0 && row.iteration % iterate_every_ == 0;
    const Numbers z{whole ? std::vector<double>(row.z.begin(), row.z.end()) : std::vector<double>()};
    report_(row.iteration, row.outer_iteration, row.objective, tuple_of(row.violations), row.kkt_residual,
            row.kappa, row.rho, row.step_length, row.regularization, row.factorizations, row.elapsed_s, z,
            row.incumbent, row.bound, row.gap, row.nodes, row.open_nodes);
  });
}

void Reporter::call(const std::function<void()>& function) {
  const py::gil_scoped_acquire gil;
  if (raised_) return;
  try {
    function();
  } catch (py::error_already_set& error) {
    raised_ = std::move(error);
    source_.request_stop();
  }
}

void Reporter::raise_if_raised() {
  if (raised_) throw std::move(*raised_);
}

bool raises_keyboard_interrupt() {
  static PyObject* const module = PyImport_ImportModule("_signal");
  static PyObject* const usual =
      module == nullptr ? nullptr : PyObject_GetAttrString(module, "default_int_handler");
  if (usual == nullptr) throw py::error_already_set();
  return py::handle(module).attr("getsignal")(SIGINT).is(py::handle(usual));
}

Options options_of(const py::dict& given) {
  Options options;
  set_options(options, given);
  if (auto valid = validate(options); !valid) raise(valid.error());
  return options;
}

py::dict run(const Options& options, const Call& call, const Solve& solve, Late late) {
  const auto begin = Clock::now();
  const auto elapsed_s = [begin] { return std::chrono::duration<double>(Clock::now() - begin).count(); };
  const double deadline_s = call.deadline_s.value_or(std::numeric_limits<double>::infinity());
  Options limited = options;
  limited.time_limit_s = std::min(options.time_limit_s, deadline_s);
  std::stop_source source = call.stop ? call.stop->source : std::stop_source();
  Reporter reporter(call.report, call.interval_s, call.iterate_every, source);
  const SolveControls controls{.progress = reporter.sink(),
                               .stop = source.get_token(),
                               .warm_start = call.warm_start ? &*call.warm_start : nullptr,
                               .sensitivity = call.derivatives ? &call.derivatives->request : nullptr,
                               .activity = call.stop ? &call.stop->activity : nullptr};
  std::optional<Expected<Solution>> outcome;
  {
    std::optional<CtrlC> ctrl_c;
    if (call.main_thread && raises_keyboard_interrupt()) ctrl_c.emplace(source);
    const py::gil_scoped_release no_gil;
    outcome = or_out_of_memory([&] { return solve(limited, controls, reporter); });
  }
  reporter.raise_if_raised();
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  Solution s = value_or_raise(std::move(*outcome));
  if (late == Late::is_error && s.status != Status::cancelled && elapsed_s() >= deadline_s)
    raise(failure(ErrorCode::deadline_exceeded, "the deadline passed while the problem was solved"));
  return dict_of(std::move(s), options, elapsed_s());
}

void bind_calls(py::module_& m) {
  py::class_<Stop, std::shared_ptr<Stop>>(m, "Stop")
      .def(py::init<>())
      .def("request", [](Stop& stop) { stop.source.request_stop(); })
      .def("activity", [](const Stop& stop) { return describe(stop.activity.read()); });
  py::class_<Call>(m, "Call").def(
      py::init([](std::optional<double> deadline_s, py::object report, double interval_s,
                  std::int32_t iterate_every, std::shared_ptr<Stop> stop, bool main_thread,
                  const py::object& warm_start, const py::object& derivatives) {
        return Call{deadline_s,
                    std::move(report),
                    interval_s,
                    iterate_every,
                    std::move(stop),
                    main_thread,
                    answer_of(warm_start),
                    asked_derivatives(derivatives)};
      }));
}

}  // namespace marble::python
