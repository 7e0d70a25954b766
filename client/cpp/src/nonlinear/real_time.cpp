#include "marble/real_time.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "nonlinear/curvature.h"
#include "nonlinear/functions.h"
#include "nonlinear/merit.h"
#include "nonlinear/subproblem.h"
#include "nonlinear/tuning.h"

namespace marble::nonlinear {

// Provides initial-value embedding: the caller's problem with rows of c_E for all measured quantities, which
// contain the measurement only in their offsets.

/// Must not move: the problem's functions refer to it.
class Embedding {
 public:
  Embedding(const Problem& problem, const Measured& measured);
  Embedding(const Embedding&) = delete;
  Embedding& operator=(const Embedding&) = delete;

  /// Checks that at least one variable is given, each once. The rows are checked once there are values.
  [[nodiscard]] Expected<void> check() const;
  [[nodiscard]] Expected<void> check_rows(const Point& point) const;

  /// Has a row x_j of c_E for each measured variable, after the caller's own rows.
  [[nodiscard]] const Problem& problem() const { return embedded_; }
  [[nodiscard]] std::size_t size() const { return measured_.variables.size() + measured_.equalities.size(); }
  /// Returns the number of added rows.
  [[nodiscard]] std::size_t variables() const { return measured_.variables.size(); }
  /// Returns the row of the k-th measured number.
  [[nodiscard]] std::size_t row(std::size_t k, const Point& point) const;

 private:
  [[nodiscard]] Values values(std::span<const double> x);
  [[nodiscard]] Derivatives derivatives(std::span<const double> x);

  Problem given_;
  Measured measured_;
  Problem embedded_;
  std::vector<double> equalities_;
  SparseMatrix jacobian_;
  std::vector<Index> row_of_;  // of a variable, among the added ones; −1
  Multipliers multipliers_;    // of the caller's rows alone
};

Embedding::Embedding(const Problem& problem, const Measured& measured)
    : given_(problem), measured_(measured), embedded_(problem), row_of_(problem.start.size(), -1) {
  if (measured_.variables.empty() || !given_.values || !given_.derivatives || !check()) return;
  for (std::size_t k = 0; k < measured_.variables.size(); ++k) {
    const auto j = static_cast<std::size_t>(measured_.variables[k]);
    row_of_[j] = static_cast<Index>(k);
    if (j < embedded_.lower.size()) embedded_.lower[j] = -std::numeric_limits<double>::infinity();
    if (j < embedded_.upper.size()) embedded_.upper[j] = std::numeric_limits<double>::infinity();
  }
  embedded_.values = [this](std::span<const double> x) { return values(x); };
  embedded_.derivatives = [this](std::span<const double> x) { return derivatives(x); };
  if (!given_.hessian) return;
  embedded_.hessian = [this](std::span<const double> x, const Multipliers& multipliers) {
    multipliers_ = multipliers;
    multipliers_.equalities.resize(multipliers.equalities.size() - measured_.variables.size());
    return given_.hessian(x, multipliers_);
  };
}

Expected<void> Embedding::check() const {
  const auto n = static_cast<Index>(given_.start.size());
  for (std::size_t k = 0; k < measured_.variables.size(); ++k) {
    const std::string field = "measured.variables";
    const auto here = measured_.variables.begin() + static_cast<std::ptrdiff_t>(k);
    if (*here < 0 || *here >= n)
      return unexpected(invalid(field, static_cast<std::int64_t>(k), std::to_string(*here),
                                "must be in [0, " + std::to_string(n) + "), a variable"));
    if (std::find(measured_.variables.begin(), here, *here) != here)
      return unexpected(
          invalid(field, static_cast<std::int64_t>(k), std::to_string(*here), "must not be named twice"));
  }
  return {};
}

Expected<void> Embedding::check_rows(const Point& point) const {
  const auto rows = static_cast<Index>(point.equalities.size() - measured_.variables.size());
  for (std::size_t k = 0; k < measured_.equalities.size(); ++k) {
    const Index row = measured_.equalities[k];
    if (row < 0 || row >= rows)
      return unexpected(invalid("measured.equalities", static_cast<std::int64_t>(k), std::to_string(row),
                                "must be in [0, " + std::to_string(rows) + "), a row of c_E"));
  }
  return {};
}

std::size_t Embedding::row(std::size_t k, const Point& point) const {
  const std::size_t variables = measured_.variables.size();
  if (k < variables) return point.equalities.size() - variables + k;
  return static_cast<std::size_t>(measured_.equalities[k - variables]);
}

Values Embedding::values(std::span<const double> x) {
  Values values = given_.values(x);
  equalities_.assign(values.equalities.begin(), values.equalities.end());
  for (const Index j : measured_.variables) equalities_.push_back(x[static_cast<std::size_t>(j)]);
  values.equalities = equalities_;
  return values;
}

// An invalid matrix is passed on unchanged: a later check reports its name.
Derivatives Embedding::derivatives(std::span<const double> x) {
  Derivatives derivatives = given_.derivatives(x);
  const SparseMatrixView& own = derivatives.equalities;
  const auto& pointers = own.column_pointers;
  const bool none = own.rows == 0;
  const bool fits = pointers.size() == x.size() + 1 && pointers.front() == 0 &&
                    std::is_sorted(pointers.begin(), pointers.end()) &&
                    static_cast<std::size_t>(pointers.back()) == own.row_indices.size() &&
                    own.values.size() == own.row_indices.size();
  if (!none && !fits) return derivatives;
  SparseMatrix& made = jacobian_;
  made.rows = own.rows + static_cast<Index>(measured_.variables.size());
  made.columns = static_cast<Index>(x.size());
  made.column_pointers.assign(1, 0), made.row_indices.clear(), made.values.clear();
  for (std::size_t j = 0; j < x.size(); ++j) {
    for (Index k = none ? 0 : pointers[j]; k < (none ? 0 : pointers[j + 1]); ++k)
      made.row_indices.push_back(own.row_indices[k]), made.values.push_back(own.values[k]);
    if (row_of_[j] >= 0) made.row_indices.push_back(own.rows + row_of_[j]), made.values.push_back(1.0);
    made.column_pointers.push_back(static_cast<Index>(made.row_indices.size()));
  }
  derivatives.equalities = made.view();
  return derivatives;
}

}  // namespace marble::nonlinear

// Implements a control step in two parts: the preparation phase, which does not depend on the measurement,
// and the LCQP with it.
namespace marble::nonlinear {
namespace {

Expected<void> check_real_time(const RealTimeSettings& s) {
  if (auto valid = validate(s.lcqp); !valid) return unexpected(inside("settings.lcqp", valid.error()));
  if (!(s.radius > 0.0 && std::isfinite(s.radius)))
    return unexpected(invalid("settings.radius", std::to_string(s.radius), "must be finite and > 0"));
  if (!(s.diagonal >= 0.0 && std::isfinite(s.diagonal)))
    return unexpected(invalid("settings.diagonal", std::to_string(s.diagonal), "must be finite and >= 0"));
  return {};
}

void offset(std::vector<ShiftBlock>& blocks, std::span<const ShiftBlock> more, std::size_t by) {
  for (ShiftBlock block : more) {
    block.first += static_cast<Index>(by);
    blocks.push_back(block);
  }
}

}  // namespace

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::answered:
      return "answered";
    case Outcome::kept:
      return "kept";
    case Outcome::shifted:
      return "shifted";
    default:
      return "elastic";
  }
}

struct RealTime::State {
  State(const Problem& problem, const Measured& measured, const RealTimeSettings& in_force)
      : embedding(problem, measured), settings(in_force) {}

  [[nodiscard]] Expected<void> begin(const OpenTicks& opens);
  [[nodiscard]] Expected<void> prepare();
  [[nodiscard]] Expected<RealTimeTick> feedback(std::span<const double> measurement, double deadline_s);
  [[nodiscard]] Expected<void> restart(std::span<const double> x);

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] Expected<std::unique_ptr<Ticks>> open(const OpenTicks& opens, const Subproblem& of) const;
  [[nodiscard]] Expected<void> linearise();
  void move();
  [[nodiscard]] Expected<bool> ask(Ticks& ticks, const Subproblem& of, const ProblemUpdate& update,
                                   const TickControls& controls, RealTimeTick& tick);
  [[nodiscard]] Expected<bool> ask_elastic(double deadline_s, RealTimeTick& tick);
  [[nodiscard]] Box box() const {
    return {functions->lower(), functions->upper(), functions->scale(), settings.radius};
  }
  [[nodiscard]] TickControls first_part() const {
    TickControls controls{.progress = settings.progress, .initial_z = no_step};
    if (shift_due) controls.shift = shift_of_answers;
    return controls;
  }

  Embedding embedding;
  RealTimeSettings settings;
  std::optional<Functions> functions;
  Point point;       // the shifted plan, with the measurement in its rows once there is one
  Linearisation at;  // at `point`
  std::optional<Model> B;
  std::optional<Weights> weights;
  std::optional<Subproblem> subproblem, elastic;
  std::unique_ptr<Ticks> ticks, elastic_ticks;
  Step step;
  std::vector<double> no_step;     // d = 0, the LCQP's start
  std::vector<double> unmeasured;  // values of the measured rows at the shifted plan
  Shift shift_of_answers;          // of the LCQP's own vectors
  bool due = false;                // the plan must be shifted
  bool shift_due = false;          // the session has not received the shift yet
  bool prepared = false;
  bool sent = false;             // the first part
  std::vector<double> returned;  // the last control step's plan
};

Expected<void> RealTime::State::begin(const OpenTicks& opens) {
  MARBLE_RETURN_IF_ERROR(check_real_time(settings));
  MARBLE_RETURN_IF_ERROR(embedding.check());
  MARBLE_ASSIGN_OR_RETURN(auto made, Functions::create(embedding.problem()));
  functions.emplace(std::move(made));
  const std::size_t n = functions->variables();
  point.x.assign(functions->start().begin(), functions->start().end());
  returned = point.x;
  MARBLE_RETURN_IF_ERROR(functions->values(point));
  if (point.fault) return unexpected(*point.fault);
  MARBLE_RETURN_IF_ERROR(embedding.check_rows(point));
  MARBLE_RETURN_IF_ERROR(functions->derivatives(point, at));
  if (at.fault) return unexpected(*at.fault);

  PartSizes sizes;  // the caller's
  sizes.g = n, sizes.b = point.equalities.size() - embedding.variables();
  sizes.d = point.inequalities.size(), sizes.l = point.G.size();
  if (auto valid = Restart{.shift = settings.shift}.check(sizes); !valid)
    return unexpected(inside("settings", valid.error()));
  shift_of_answers.equalities = settings.shift.equalities;
  shift_of_answers.inequalities = settings.shift.inequalities;
  offset(shift_of_answers.inequalities, settings.shift.variables, sizes.d);  // rows of the lower bounds
  offset(shift_of_answers.inequalities, settings.shift.variables, sizes.d + n);
  shift_of_answers.pairs = settings.shift.pairs;

  const Curvature kind = chosen(settings.curvature, embedding.problem(), point);
  if (kind == Curvature::bfgs)
    return unexpected(
        invalid("settings.curvature", "bfgs",
                "must be exact, gauss_newton or none: the problem needs a Hessian or residuals"));
  if (kind == Curvature::exact && !embedding.problem().hessian)
    return unexpected(invalid("hessian", "must be a function: the settings ask for the exact curvature"));
  Multipliers& m = step.multipliers;
  m.equalities.assign(point.equalities.size(), 0.0), m.inequalities.assign(sizes.d, 0.0),
      m.G.assign(sizes.l, 0.0);
  m.H.assign(sizes.l, 0.0), m.bounds.assign(n, 0.0);
  step.d.assign(n, 0.0), no_step.assign(n, 0.0), unmeasured.assign(embedding.size(), 0.0);
  MARBLE_ASSIGN_OR_RETURN(B, Model::create(kind, *functions, point, at, m));
  B->shift(settings.diagonal);
  weights.emplace(rows_of(point), tuning::first_weight);
  subproblem.emplace(at, B->upper(), false);
  subproblem->set(point, at, B->upper(), box());
  auto opened = open(opens, *subproblem);
  if (!opened) return unexpected(opened.error());
  ticks = std::move(*opened);
  if (settings.fallback != Fallback::elastic) return {};
  elastic.emplace(at, B->upper(), true);
  opened = open(opens, *elastic);
  if (!opened) return unexpected(opened.error());
  elastic_ticks = std::move(*opened);
  return {};
}

Expected<std::unique_ptr<Ticks>> RealTime::State::open(const OpenTicks& opens, const Subproblem& of) const {
  Settings one;
  one.progress = settings.progress, one.stop = settings.stop, one.reopen = settings.reopen;
  one.lcqp = settings.lcqp;
  return opens(of.view(), one);
}

Expected<void> RealTime::State::prepare() {
  prepared = false;
  if (std::exchange(due, false)) move();
  MARBLE_RETURN_IF_ERROR(linearise());
  MARBLE_ASSIGN_OR_RETURN(sent, ticks->prepare(subproblem->update(), first_part()));
  if (sent) shift_due = false;
  prepared = true;
  return {};
}

void RealTime::State::move() {
  shift(settings.shift.variables, point.x);
  if (settings.moved) settings.moved(point.x);
  Multipliers& m = step.multipliers;
  shift(settings.shift.variables, m.bounds);
  shift(settings.shift.equalities, m.equalities), shift(settings.shift.inequalities, m.inequalities);
  shift(settings.shift.pairs, m.G), shift(settings.shift.pairs, m.H);
  shift_due = true;
}

Expected<void> RealTime::State::linearise() {
  MARBLE_RETURN_IF_ERROR(functions->values(point));
  if (point.fault) return unexpected(*point.fault);
  MARBLE_RETURN_IF_ERROR(functions->derivatives(point, at));
  if (at.fault) return unexpected(*at.fault);
  MARBLE_RETURN_IF_ERROR(B->move(*functions, point, at, step.multipliers, {}, {}));
  B->shift(settings.diagonal);
  for (std::size_t k = 0; k < unmeasured.size(); ++k)
    unmeasured[k] =
        std::exchange(point.equalities[embedding.row(k, point)], 0.0);  // as if measured as planned
  subproblem->set(point, at, B->upper(), box());
  return {};
}

Expected<RealTimeTick> RealTime::State::feedback(std::span<const double> measurement, double deadline_s) {
  const auto begun = Clock::now();
  const auto elapsed_s = [&] { return std::chrono::duration<double>(Clock::now() - begun).count(); };
  const auto left_s = [&] { return std::max(0.0, deadline_s - elapsed_s()); };
  MARBLE_RETURN_IF_ERROR(check_numbers(measurement, embedding.size(), "measurement"));
  if (!prepared) {
    MARBLE_RETURN_IF_ERROR(prepare());
  }
  prepared = false;
  for (std::size_t k = 0; k < measurement.size(); ++k)
    point.equalities[embedding.row(k, point)] = unmeasured[k] - measurement[k];
  const ProblemUpdate measured = subproblem->set_equalities(point);
  TickControls controls{.progress = settings.progress};
  if (!sent) controls = first_part();
  controls.deadline_s = left_s();
  RealTimeTick tick;
  const std::int32_t reopened = ticks->reopened();
  auto answered = ask(*ticks, *subproblem, sent ? measured : subproblem->update(), controls, tick);
  shift_due = false;
  if (!answered) return unexpected(answered.error());
  if (!*answered && tick.deadline_met && settings.fallback == Fallback::elastic) {
    answered = ask_elastic(left_s(), tick);
    if (!answered) return unexpected(answered.error());
  }
  tick.deadline_met = tick.deadline_met && elapsed_s() <= deadline_s;
  tick.reopened = ticks->reopened() - reopened;
  if (*answered) {
    for (std::size_t j = 0; j < step.d.size(); ++j) point.x[j] += step.d[j];
    weights->rise_above(step.multipliers);
    tick.outcome = step.elastic ? Outcome::elastic : Outcome::answered;
    tick.x = point.x, tick.step = step.size, tick.b_stationary = step.b_stationary;
    tick.violation = largest_violation(step.rows());
  } else {
    tick.outcome = settings.fallback == Fallback::keep ? Outcome::kept : Outcome::shifted;
    tick.x = settings.fallback == Fallback::keep ? returned : point.x;
    tick.violation = largest_violation(rows_of(point));
  }
  tick.multipliers = step.multipliers;
  tick.multipliers.equalities.resize(step.multipliers.equalities.size() - embedding.variables());
  returned = tick.x;
  due = true;
  return tick;
}

// Returns true if there is a step.
Expected<bool> RealTime::State::ask(Ticks& of, const Subproblem& asked, const ProblemUpdate& update,
                                    const TickControls& controls, RealTimeTick& tick) {
  const bool first = tick.ticks++ == 0;
  auto solution = of.solve(update, controls);
  if (!solution) {
    const ErrorCode code = solution.error().code;
    if (code != ErrorCode::deadline_exceeded && code != ErrorCode::resource_exhausted)
      return unexpected(solution.error());
    if (code == ErrorCode::deadline_exceeded) tick.deadline_met = false;
    if (first) tick.status = Status::time_limit;
    tick.why = solution.error().message();
    return false;
  }
  tick.factorizations += solution->factorizations;
  const bool cut = solution->status == Status::time_limit && controls.deadline_s < settings.lcqp.time_limit_s;
  if (cut) tick.deadline_met = false;
  if (first) tick.status = solution->status;
  if (solution->status == Status::cancelled)
    return unexpected(failure(ErrorCode::cancelled, "stopped within a tick"));
  const bool solved = is_solved(solution->status);
  if (!solved || solution->second_order == SecondOrder::saddle) {
    tick.why = solved ? "the LCQP's answer is a saddle point: it wants a larger settings.diagonal"
                      : std::string(to_string(solution->status)) + ": " + solution->detail;
    return false;
  }
  asked.read(*solution, point, at, box(), step);
  return true;
}

Expected<bool> RealTime::State::ask_elastic(double deadline_s, RealTimeTick& tick) {
  elastic->set(point, at, B->upper(), box());
  elastic->set_weights(*weights);
  const std::string why = tick.why;
  auto answered = ask(*elastic_ticks, *elastic, elastic->update(),
                      {.cold = true, .deadline_s = deadline_s, .progress = settings.progress}, tick);
  if (answered && *answered) tick.why = why;
  return answered;
}

Expected<void> RealTime::State::restart(std::span<const double> x) {
  MARBLE_RETURN_IF_ERROR(check_numbers(x, point.x.size(), "x"));
  point.x.assign(x.begin(), x.end());
  returned = point.x;
  due = prepared = false;
  return {};
}

RealTime::RealTime(std::unique_ptr<State> state) : state_(std::move(state)) {}
RealTime::RealTime(RealTime&&) noexcept = default;
RealTime& RealTime::operator=(RealTime&&) noexcept = default;
RealTime::~RealTime() = default;

Expected<RealTime> RealTime::create(const Problem& problem, const Measured& measured, const OpenTicks& open,
                                    const RealTimeSettings& settings) {
  return or_out_of_memory([&]() -> Expected<RealTime> {
    auto state = std::make_unique<State>(problem, measured, settings);
    MARBLE_RETURN_IF_ERROR(state->begin(open));
    return RealTime(std::move(state));
  });
}

Expected<void> RealTime::prepare() {
  return or_out_of_memory([&] { return state_->prepare(); });
}

Expected<RealTimeTick> RealTime::feedback(std::span<const double> measurement, double deadline_s) {
  return or_out_of_memory([&] { return state_->feedback(measurement, deadline_s); });
}

Expected<void> RealTime::restart(std::span<const double> x) {
  return or_out_of_memory([&] { return state_->restart(x); });
}

}  // namespace marble::nonlinear
