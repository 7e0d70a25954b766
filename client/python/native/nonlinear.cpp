#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "answers.h"
#include "arrays.h"
#include "bindings.h"

namespace marble::python {
namespace {

/// The last result of one function as views, and the arrays they borrow.
struct Given {
  py::object kept;
  std::optional<Borrowed> arrays;

  const py::object& keep(py::object object) {
    arrays.emplace();
    kept = std::move(object);
    return kept;
  }
  SparseMatrixView matrix(const py::handle& csc) {
    if (csc.is_none()) return {};
    const auto shape = csc.attr("shape").cast<std::pair<std::size_t, std::size_t>>();
    return arrays->matrix(csc, shape.first, shape.second);
  }
};

class ReleasedTicks final : public nonlinear::Ticks {
 public:
  explicit ReleasedTicks(std::unique_ptr<nonlinear::Ticks> ticks) : ticks_(std::move(ticks)) {}
  Expected<Solution> solve(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    const py::gil_scoped_release no_gil;
    return ticks_->solve(update, controls);
  }
  Expected<bool> prepare(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    const py::gil_scoped_release no_gil;
    return ticks_->prepare(update, controls);
  }

 private:
  std::unique_ptr<nonlinear::Ticks> ticks_;
};

/// Solves subproblems in a session of the Python client.
class CalledTicks final : public nonlinear::Ticks {
 public:
  explicit CalledTicks(py::object tick) : tick_(std::move(tick)) {}

  Expected<bool> prepare(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    static_cast<void>(ask(update, controls, true));
    return true;
  }

  Expected<Solution> solve(const ProblemUpdate& update, const nonlinear::TickControls& controls) override {
    const py::object answer = ask(update, controls, false);
    if (answer.is_none()) return unexpected(failure(ErrorCode::deadline_exceeded, "the deadline has passed"));
    const auto parts = py::tuple(answer);
    reopened_ += parts[1].cast<bool>() ? 1 : 0;
    return solution_of(parts[0]);
  }

  [[nodiscard]] std::int32_t reopened() const override { return reopened_; }

 private:
  static constexpr double kForever = 1e8;  // seconds: no deadline is sent

  py::object ask(const ProblemUpdate& update, const nonlinear::TickControls& controls, bool first_part) {
    const bool limited = controls.deadline_s < kForever;
    const Shift& shift = controls.shift;
    const py::object z0 = controls.initial_z.empty() ? py::none() : py::cast(copied(controls.initial_z));
    return tick_(dict_of(update), controls.cold,
                 limited ? py::object(py::float_(controls.deadline_s)) : py::object(py::none()),
                 py::make_tuple(tuples_of(shift.variables), tuples_of(shift.equalities),
                                tuples_of(shift.inequalities), tuples_of(shift.pairs)),
                 z0, first_part);
  }
  static py::list tuples_of(const std::vector<ShiftBlock>& blocks) {
    py::list list;
    for (const ShiftBlock& block : blocks) list.append(py::make_tuple(block.first, block.count, block.by));
    return list;
  }

  py::object tick_;
  std::int32_t reopened_ = 0;
};

Expected<std::unique_ptr<nonlinear::Ticks>> open_here(const ProblemView& view,
                                                      const nonlinear::Settings& settings) {
  MARBLE_ASSIGN_OR_RETURN(auto ticks, nonlinear::open_ticks_in_process(view, settings));
  return std::make_unique<ReleasedTicks>(std::move(ticks));
}

/// Calls Python functions, and keeps their last results.
class Called {
 public:
  /// `problem` must outlive it.
  explicit Called(const py::dict& problem) {
    made_.values = [this, &problem](std::span<const double> x) -> nonlinear::Values {
      const auto parts = py::tuple(values_.keep(problem["values"](copied(x))));
      Borrowed& arrays = *values_.arrays;
      return {parts[0].cast<double>(),  arrays.doubles(parts[1]), arrays.doubles(parts[2]),
              arrays.doubles(parts[3]), arrays.doubles(parts[4]), arrays.doubles(parts[5])};
    };
    made_.derivatives = [this, &problem](std::span<const double> x) -> nonlinear::Derivatives {
      Given& given = derivatives_;
      const auto parts = py::tuple(given.keep(problem["derivatives"](copied(x))));
      return {given.arrays->doubles(parts[0]), given.matrix(parts[1]), given.matrix(parts[2]),
              given.matrix(parts[3]),          given.matrix(parts[4]), given.matrix(parts[5])};
    };
    if (!problem["hessian"].is_none()) {
      made_.hessian = [this, &problem](std::span<const double> x, const nonlinear::Multipliers& m) {
        const py::object upper = problem["hessian"](copied(x), copied(m.equalities), copied(m.inequalities),
                                                    copied(m.G), copied(m.H));
        return hessian_.matrix(hessian_.keep(upper));
      };
    }
    made_.start = owned(problem["start"]), made_.lower = owned(problem["lower"]);
    made_.upper = owned(problem["upper"]), made_.scale = owned(problem["scale"]);
    Borrowed arrays;
    const auto blocks = arrays.indices(problem["blocks"]);
    made_.blocks.assign(blocks.begin(), blocks.end());
  }
  Called(const Called&) = delete;
  Called& operator=(const Called&) = delete;

  [[nodiscard]] const nonlinear::Problem& problem() const { return made_; }

 private:
  nonlinear::Problem made_;
  Given values_, derivatives_, hessian_;
};

}  // namespace

nonlinear::Problem problem_of(const py::dict& problem) {
  struct Kept {
    explicit Kept(py::dict own) : given(std::move(own)), called(given) {}
    py::dict given;
    Called called;
  };
  const auto kept = std::make_shared<Kept>(problem);
  const nonlinear::Problem& all = kept->called.problem();
  nonlinear::Problem made = all;
  made.values = [kept, &all](std::span<const double> x) { return all.values(x); };
  made.derivatives = [kept, &all](std::span<const double> x) { return all.derivatives(x); };
  if (!all.hessian) return made;
  made.hessian = [kept, &all](std::span<const double> x, const nonlinear::Multipliers& multipliers) {
    return all.hessian(x, multipliers);
  };
  return made;
}

nonlinear::OpenTicks ticks_of(const py::object& open) {
  if (open.is_none()) return open_here;
  return [open](const ProblemView& view,
                const nonlinear::Settings&) -> Expected<std::unique_ptr<nonlinear::Ticks>> {
    return std::make_unique<CalledTicks>(open(dict_of(view)));
  };
}

Expected<nonlinear::Answer> solve_nonlinear(const py::dict& problem, const nonlinear::Settings& settings,
                                            const py::object& open) {
  const Called called(problem);
  return nonlinear::solve(called.problem(), ticks_of(open), settings);
}

Expected<nonlinear::RetrospectiveAnswer> solve_retrospective(const py::dict& problem,
                                                             const nonlinear::RetrospectiveSettings& settings,
                                                             const py::object& use_samples,
                                                             const py::object& sample_cost,
                                                             const py::object& open) {
  const Called called(problem);
  nonlinear::SampledProblem sampled;
  sampled.problem = called.problem();
  sampled.use_samples = [&use_samples](std::int64_t N) { use_samples(N); };
  if (!sample_cost.is_none()) {
    sampled.sample_cost = [&sample_cost](std::span<const double> x, std::int64_t sample) {
      return sample_cost(copied(x), sample).cast<double>();
    };
  }
  return nonlinear::solve_retrospective(sampled, ticks_of(open), settings);
}

}  // namespace marble::python
