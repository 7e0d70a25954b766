#include <chrono>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "answers.h"
#include "arrays.h"
#include "bindings.h"
#include "call.h"
#include "marble/composite/coupled_progress.h"
#include "marble/composite/lifted_block.h"
#include "marble/composite/segments.h"
#include "marble/composite/waiting_threads.h"

namespace marble::python {
namespace {

// Uses the field names of a request's message.
Error named(Error error) {
  const bool of_segments =
      error.field == "stages" || error.field == "num_segments" || error.field == "overlap";
  return inside(of_segments ? "coupled.segments" : "coupled", std::move(error));
}

void take(const py::dict& given, CoupledOptions& settings) {
  const auto set = [&given](const char* name, auto& value) {
    if (given.contains(name)) value = given[name].cast<std::decay_t<decltype(value)>>();
  };
  set("proximal", settings.proximal);
  set("max_iterations", settings.max_iterations);
  set("freeze_after", settings.freeze_after);
  set("max_searches", settings.max_searches);
  set("max_pair_switches", settings.max_pair_switches);
  set("tolerance", settings.tolerance);
  set("monolithic", settings.monolithic);
  set("monolithic_search", settings.monolithic_search);
}

py::dict reported_of(const Coordination& c, double blocks_objective) {
  py::dict reported;
  reported["status"] = to_string(c.status);
  reported["detail"] = c.detail;
  reported["iterations"] = c.last.iteration;
  reported["violation"] = c.last.coupling_violation;
  reported["step"] = c.last.step;
  reported["proximal"] = c.last.proximal;
  reported["frozen_at"] = c.frozen_at;
  reported["pair_switches"] = c.pair_switches;
  reported["factorizations"] = c.last.factorizations;
  reported["objective"] = blocks_objective;
  reported["failed"] = c.failed_block ? py::object(py::int_(*c.failed_block)) : py::object(py::none());
  reported["sweep_objective"] = py::none();
  reported["sweep_factorizations"] = 0;
  return reported;
}

// A block that Python solves.
class CalledBlock final : public BlockSolver {
 public:
  CalledBlock(py::object solve, const Options& options, Reporter& reporter)
      : solve_(std::move(solve)), options_(options), reporter_(reporter) {}
  CalledBlock(const CalledBlock&) = delete;
  CalledBlock& operator=(const CalledBlock&) = delete;
  ~CalledBlock() override {
    const py::gil_scoped_acquire gil;
    solve_.release().dec_ref();
  }

  Expected<Solution> solve(const ProblemUpdate& update, const Solution* start) override {
    Expected<Solution> answer = unexpected(raised());
    reporter_.call([&] {
      const py::object from = start == nullptr ? py::none() : py::object(dict_of(*start, options_, 0.0));
      answer = solution_of(solve_(dict_of(update), from));
    });
    return answer;
  }

  // The error after an exception in Python, which is raised at the end.
  [[nodiscard]] static Error raised() {
    return failure(ErrorCode::cancelled, "a function of Python's has raised");
  }

 private:
  py::object solve_;
  const Options& options_;
  Reporter& reporter_;
};

void solve_by(const py::object& open, const Options& options, Reporter& reporter, TaskRunner& threads,
              CoupledControls& controls) {
  if (open.is_none()) return;
  controls.runner = &threads;
  controls.open = [&](const LiftedBlock& block) -> Expected<std::unique_ptr<BlockSolver>> {
    Expected<std::unique_ptr<BlockSolver>> opened = unexpected(CalledBlock::raised());
    reporter.call([&] {
      opened = std::make_unique<CalledBlock>(open(dict_of(block.problem().view()), block.name()), options,
                                             reporter);
    });
    return opened;
  };
}

CoupledControls controls_of(const SolveControls& given) {
  CoupledControls controls{.stop = given.stop, .activity = given.activity};
  if (given.progress != nullptr) {
    controls.progress = [sink = given.progress,
                         begun = std::chrono::steady_clock::now()](const CoupledIteration& iteration) {
      const std::chrono::duration<double> past = std::chrono::steady_clock::now() - begun;
      sink->report(row_of(iteration, past.count()));
    };
  }
  return controls;
}

py::dict solve(const py::list& blocks, const py::object& coupling_rhs, const py::object& coupling_multipliers,
               const py::dict& given, const py::dict& request, const py::object& open, const Call& call) {
  CoupledOptions settings{.options = options_of(given)};
  take(request, settings);
  Borrowed arrays;
  CoupledView view{{}, arrays.doubles(coupling_rhs)};
  for (const py::handle block : blocks) {
    const auto parts = block.cast<py::tuple>();
    CoupledBlock& own = view.blocks.emplace_back();
    own.name = parts[0].attr("name").cast<std::string>();
    own.problem = arrays.problem(parts[0]);
    if (!parts[1].is_none())
      own.coupling = arrays.matrix(parts[1], view.coupling_rhs.size(), own.problem.g.size());
  }
  CoupledStart start;
  if (!coupling_multipliers.is_none()) {
    const auto numbers = arrays.doubles(coupling_multipliers);
    start.coupling_multipliers.assign(numbers.begin(), numbers.end());
  }
  CoupledSolution answer;
  const Options options = settings.options;
  py::dict reported =
      run(options, call,
          [&](const Options& limited, const SolveControls& sent, Reporter& reporter) -> Expected<Solution> {
            settings.options = limited;
            CoupledControls controls = controls_of(sent);
            WaitingThreads threads;
            solve_by(open, settings.options, reporter, threads, controls);
            if (!start.coupling_multipliers.empty()) controls.start = &start;
            auto solved = solve_coupled(view, settings, controls);
            if (!solved) return unexpected(named(solved.error()));
            Solution monolithic = std::exchange(solved->monolithic, {});
            answer = *std::move(solved);
            return monolithic;
          });
  reported["coupled"] = reported_of(answer.coordination, answer.blocks_objective);
  reported["coupling_multipliers"] = Numbers{std::move(answer.coordination.coupling_multipliers)};
  return reported;
}

py::dict solve_segments(const py::object& lcqp, const py::object& stages, Index segments, Index overlap,
                        const py::dict& given, const py::dict& request, const py::object& open,
                        const Call& call) {
  SegmentsOptions settings{.num_segments = segments, .overlap = overlap};
  settings.coupled.options = options_of(given);
  take(request, settings.coupled);
  Borrowed arrays;
  const Problem problem = value_or_raise(Problem::create(arrays.problem(lcqp)));
  const std::span<const Index> stage_of_variable = arrays.indices(stages);
  SegmentsSolution answer;
  const Options options = settings.coupled.options;
  py::dict reported =
      run(options, call,
          [&](const Options& limited, const SolveControls& sent, Reporter& reporter) -> Expected<Solution> {
            settings.coupled.options = limited;
            CoupledControls controls = controls_of(sent);
            WaitingThreads threads;
            solve_by(open, settings.coupled.options, reporter, threads, controls);
            auto solved = solve_in_segments(problem, stage_of_variable, settings, controls);
            if (!solved) return unexpected(named(solved.error()));
            Solution whole = std::exchange(solved->whole, {});
            answer = *std::move(solved);
            return whole;
          });
  py::dict coordination = reported_of(answer.coordination, answer.blocks_objective);
  coordination["sweep_objective"] = answer.sweep_objective;
  coordination["sweep_factorizations"] = answer.sweep_factorizations;
  reported["coupled"] = coordination;
  return reported;
}

}  // namespace

void bind_coupled(py::module_& m) {
  m.def("solve_coupled", &solve);
  m.def("solve_in_segments", &solve_segments);
}

}  // namespace marble::python
