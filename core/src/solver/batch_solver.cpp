#include "marble/batch_solver.h"

#include <algorithm>
#include <atomic>
#include <barrier>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "marble/owned.h"
#include "model/interrupt.h"
#include "model/tuning.h"
#include "solver/batch_order.h"

namespace marble {
namespace {

constexpr int most_threads = 256;

ProblemUpdate all_numbers(const OwnedProblem& p) {
  return {p.c0, p.g, p.b, p.d, p.l, p.r, p.Q.values, p.A.values, p.C.values, p.L.values, p.R.values};
}

std::span<const double> element(std::span<const double> values, std::size_t size, std::size_t i) {
  return values.empty() ? values : values.subspan(i * size, size);
}

// Checks the size of one part, or that it is absent.
Expected<void> check_size(std::size_t given, std::size_t count, std::size_t size, const char* field) {
  if (given == 0 || (size > 0 && given % size == 0 && given / size == count)) return {};
  return unexpected(invalid(field, std::to_string(given) + " entries",
                            "must have none, or " + std::to_string(count) + " x " + std::to_string(size) +
                                " (elements x entries of one)"));
}

Expected<void> check_part(std::span<const double> values, std::size_t count, std::size_t size,
                          const char* field) {
  MARBLE_RETURN_IF_ERROR(check_size(values.size(), count, size, field));
  if (values.empty()) return {};
  for (std::size_t i = 0; i < count; ++i) {
    const std::span<const double> own = values.subspan(i * size, size);
    if (std::ranges::all_of(own, [](double value) { return std::isfinite(value); })) continue;
    auto fault = check_numbers(own, size, field);
    fault.error().field += "[" + std::to_string(i) + "]";
    return fault;
  }
  return {};
}

Expected<void> check_numbers(const BatchNumbers& numbers, const PartSizes& sizes) {
  if (numbers.count > most_batch_elements)
    return unexpected(invalid("count", std::to_string(numbers.count),
                              "must be in [0, " + std::to_string(most_batch_elements) + "]"));
  const struct {
    const char* field;
    std::span<const double> values;
    std::size_t size;
  } parts[] = {{"c0", numbers.c0, 1},
#define MARBLE_VECTOR(letter, field) {#letter, numbers.letter, sizes.letter},
#define MARBLE_MATRIX(letter, field, values, vector) {#letter ".values", numbers.letter, sizes.letter},
#include "marble/contract.def"
               {"initial_z", numbers.initial_z, sizes.g}};
  for (const auto& part : parts) {
    MARBLE_RETURN_IF_ERROR(check_part(part.values, numbers.count, part.size, part.field));
  }
  return {};
}

// Its numbers are checked where they are used: an element that is not solved has none to start from.
Expected<void> check_start(const BatchResult& start, std::size_t count, const PartSizes& sizes) {
  if (start.count != count || start.status.size() != count)
    return unexpected(invalid("start", std::to_string(start.count) + " elements",
                              "must have " + std::to_string(count) + ", as many as the batch"));
  const struct {
    const char* field;
    std::size_t given, size;
  } vectors[] = {
      {"start.z", start.z.size(), sizes.g},
      {"start.equality_multipliers", start.equality_multipliers.size(), sizes.b},
      {"start.inequality_multipliers", start.inequality_multipliers.size(), sizes.d},
      {"start.complementarity_multipliers_L", start.complementarity_multipliers_L.size(), sizes.l},
      {"start.complementarity_multipliers_R", start.complementarity_multipliers_R.size(), sizes.r}};
  for (const auto& vector : vectors) {
    if (vector.given != count * vector.size)
      return unexpected(invalid(vector.field, std::to_string(vector.given) + " entries",
                                "must have " + std::to_string(count) + " x " + std::to_string(vector.size) +
                                    ": the start needs the multipliers of its batch"));
  }
  return {};
}

// Whether elements may start from others: not if each is to be searched for as a cold solve does it.
bool may_start_near(const Options& o) {
  return o.path == Path::fast && o.polish && !o.global_search && o.num_starts == 1;
}

}  // namespace

std::size_t BatchResult::solved() const {
  return static_cast<std::size_t>(std::ranges::count_if(status, is_solved));
}

struct BatchSolver::State {
  OwnedProblem pattern;
  PartSizes sizes;
  Options options;
  SetupControls limits;
  std::vector<std::optional<Solver>> solvers;  // one for each thread so far
};

// One call of solve().
class BatchSolver::Batch {
 public:
  Batch(State& state, const BatchNumbers& numbers, const BatchSolverControls& controls)
      : state_(state),
        numbers_(numbers),
        controls_(controls),
        begun_(Interrupt::now(nullptr)),
        interrupt_(controls.stop, after(begun_, state.options.time_limit_s)),
        pattern_numbers_(all_numbers(state.pattern)),
        order_(numbers.count, parts()),
        kept_(order_.kept()),
        usable_(order_.kept()) {
    make_levels();
    make_result();
  }

  // Returns false if memory ran out.
  [[nodiscard]] bool run(std::size_t threads);

  BatchResult result;

 private:
  struct NextLevel {
    Batch* batch;
    void operator()() noexcept { batch->next_ = batch->ends_[batch->level_++]; }
  };

  [[nodiscard]] std::vector<BatchPart> parts() const {
    const PartSizes& sizes = state_.sizes;
    return {
#define MARBLE_VECTOR(letter, field) {numbers_.letter, sizes.letter},
#define MARBLE_MATRIX(letter, field, values, vector) {numbers_.letter, sizes.letter},
#include "marble/contract.def"
    };
  }
  void make_levels();
  void make_result();
  void work(std::optional<Solver>& solver, std::barrier<NextLevel>& levels_end);
  [[nodiscard]] bool set_up(std::optional<Solver>& solver) const;
  void solve(Solver& solver, std::size_t position, std::size_t solved_end);
  [[nodiscard]] ProblemUpdate update_of(std::size_t i) const;
  [[nodiscard]] Solution own_start(std::size_t i) const;
  void take(std::size_t i, const Solution& solution);
  [[nodiscard]] std::optional<Status> ended() const {
    if (!interrupt_.requested()) return std::nullopt;
    return interrupt_.stop_requested() ? Status::cancelled : Status::time_limit;
  }

  State& state_;
  const BatchNumbers& numbers_;
  const BatchSolverControls& controls_;
  const Interrupt::Clock::time_point begun_;
  const Interrupt interrupt_;
  const ProblemUpdate pattern_numbers_;
  const BatchOrder order_;
  std::vector<Solution> kept_;        // of the first elements in the order
  std::vector<std::uint8_t> usable_;  // 1 where it is solved
  std::vector<std::size_t> ends_;     // of the levels: elements of one start from those of the ones before it
  std::size_t level_ = 0;
  std::atomic<std::size_t> next_ = 0;
  std::atomic<std::size_t> workers_ = 0;
  std::atomic<bool> out_of_memory_ = false;
};

// Each level has as many elements as all before it, until all that others may start from are solved.
void BatchSolver::Batch::make_levels() {
  const std::size_t count = numbers_.count;
  const bool alone = !may_start_near(state_.options);
  std::size_t end =
      alone ? count : std::clamp(count / tuning::batch_cold, std::size_t{1}, tuning::batch_cold);
  for (; end < count; end = end < order_.kept() ? std::min(2 * end, order_.kept()) : count)
    ends_.push_back(end);
  ends_.push_back(count);
}

void BatchSolver::Batch::make_result() {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const std::size_t count = numbers_.count;
  const PartSizes& sizes = state_.sizes;
  result.count = count;
  result.status.assign(count, Status::cancelled);
  result.z.assign(count * sizes.g, kNone);
  result.objective.assign(count, kNone);
  result.violations.assign(3 * count, kNone);
  result.kkt_residual.assign(count, kNone);
  result.factorizations.assign(count, 0);
  if (!controls_.multipliers) return;
  result.equality_multipliers.assign(count * sizes.b, kNone);
  result.inequality_multipliers.assign(count * sizes.d, kNone);
  result.complementarity_multipliers_L.assign(count * sizes.l, kNone);
  result.complementarity_multipliers_R.assign(count * sizes.r, kNone);
}

bool BatchSolver::Batch::run(std::size_t threads) {
  next_ = 0;
  std::barrier<NextLevel> levels_end(static_cast<std::ptrdiff_t>(threads), NextLevel{this});
  {
    std::vector<std::jthread> others;
    others.reserve(threads);
    for (std::size_t k = 1; k < threads; ++k) {
      try {
        others.emplace_back([this, k, &levels_end] { work(state_.solvers[k], levels_end); });
      } catch (const std::system_error&) {  // no more threads: fewer give the same result
        levels_end.arrive_and_drop();
      }
    }
    work(state_.solvers[0], levels_end);
  }
  result.solve_s = std::chrono::duration<double>(Interrupt::now(nullptr) - begun_).count();
  return !out_of_memory_ && workers_ > 0;
}

// A thread without memory for its solver leaves the work to the others.
void BatchSolver::Batch::work(std::optional<Solver>& solver, std::barrier<NextLevel>& levels_end) {
  if (!set_up(solver)) return levels_end.arrive_and_drop();
  ++workers_;
  std::size_t begin = 0;
  for (const std::size_t end : ends_) {
    for (std::size_t first = next_.fetch_add(tuning::batch_task); first < end;
         first = next_.fetch_add(tuning::batch_task)) {
      for (std::size_t p = first; p < std::min(end, first + tuning::batch_task) && !out_of_memory_; ++p) {
        try {
          solve(*solver, p, begin);
        } catch (const std::bad_alloc&) {
          out_of_memory_ = true;
        }
      }
    }
    levels_end.arrive_and_wait();
    begin = end;
  }
}

bool BatchSolver::Batch::set_up(std::optional<Solver>& solver) const {
  try {
    if (!solver) {
      SetupControls limits = state_.limits;
      limits.stop = controls_.stop;
      auto made = Solver::create(*Problem::create(state_.pattern.view()), state_.options, limits);
      if (!made) return false;
      solver.emplace(*std::move(made));
    }
    solver->return_to_setup(pattern_numbers_);
  } catch (const std::bad_alloc&) {
    return false;
  }
  return true;
}

ProblemUpdate BatchSolver::Batch::update_of(std::size_t i) const {
  const PartSizes& sizes = state_.sizes;
  ProblemUpdate update;
  if (!numbers_.c0.empty()) update.c0 = numbers_.c0[i];
#define MARBLE_VECTOR(letter, field) update.letter = element(numbers_.letter, sizes.letter, i);
#define MARBLE_MATRIX(letter, field, values, vector) \
  update.letter = element(numbers_.letter, sizes.letter, i);
#include "marble/contract.def"
  // A row that has become empty may have lost its constant.
  if (update.b.empty() && !update.A.empty()) update.b = state_.pattern.b;
  if (update.d.empty() && !update.C.empty()) update.d = state_.pattern.d;
  if (update.l.empty() && !update.L.empty()) update.l = state_.pattern.l;
  if (update.r.empty() && !update.R.empty()) update.r = state_.pattern.r;
  return update;
}

// Of the result to start from; without numbers if that is no solution, or not one that can be used.
Solution BatchSolver::Batch::own_start(std::size_t i) const {
  Solution solution;
  const BatchResult& start = *controls_.start;
  if (!is_solved(start.status[i])) return solution;
  const PartSizes& sizes = state_.sizes;
  const auto copy = [i](const std::vector<double>& from, std::size_t size) {
    const std::span<const double> own = std::span(from).subspan(i * size, size);
    return std::vector<double>(own.begin(), own.end());
  };
  solution.z = copy(start.z, sizes.g);
  solution.equality_multipliers = copy(start.equality_multipliers, sizes.b);
  solution.inequality_multipliers = copy(start.inequality_multipliers, sizes.d);
  solution.complementarity_multipliers_L = copy(start.complementarity_multipliers_L, sizes.l);
  solution.complementarity_multipliers_R = copy(start.complementarity_multipliers_R, sizes.r);
  if (!check_warm_start(solution, sizes)) solution.z.clear();
  return solution;
}

// Elements at positions below `solved_end` are solved, or have ended without a solution.
void BatchSolver::Batch::solve(Solver& solver, std::size_t position, std::size_t solved_end) {
  const std::size_t i = order_.elements()[position];
  if (const auto status = ended()) {
    result.status[i] = *status;
    return;
  }
  solver.take_element(update_of(i), pattern_numbers_);
  const bool keeps = position < kept_.size();
  std::vector<std::size_t> positions;
  std::vector<const Solution*> near;
  Solution own;
  if (may_start_near(state_.options)) {
    order_.find_nearest(i, std::span(usable_).first(std::min(solved_end, usable_.size())),
                        keeps ? tuning::batch_near_kept : tuning::batch_near, positions);
    if (controls_.start != nullptr) own = own_start(i);
    if (!own.z.empty()) near.push_back(&own);
    for (const std::size_t p : positions) near.push_back(&kept_[p]);
  }
  const std::span<const double> initial_z = element(numbers_.initial_z, state_.sizes.g, i);
  SolveControls controls{.stop = controls_.stop, .initial_z = initial_z, .begun = begun_};
  const Solution* first = near.empty() ? nullptr : near.front();
  Solution reference;  // with a given point, the session's rule for such steps
  if (!initial_z.empty() && first != nullptr) {
    reference = *first;
    reference.reference_objective = std::numeric_limits<double>::infinity();
    controls.warm_start = &reference;
    near.clear();
  }
  auto solution = solver.solve(controls, false, !initial_z.empty(), near, keeps);
  if (!solution) {  // the inputs were checked: nothing else is refused
    result.status[i] = Status::numerical_failure;
    return;
  }
  take(i, *solution);
  if (!keeps) return;
  usable_[position] = is_solved(solution->status);
  kept_[position] = *std::move(solution);
}

void BatchSolver::Batch::take(std::size_t i, const Solution& solution) {
  result.status[i] = solution.status;
  result.objective[i] = solution.objective;
  result.kkt_residual[i] = solution.kkt_residual;
  result.factorizations[i] = solution.factorizations;
  double* violations = &result.violations[3 * i];
  violations[0] = solution.violations.equality;
  violations[1] = solution.violations.inequality;
  violations[2] = solution.violations.complementarity;
  const auto copy = [i](const std::vector<double>& from, std::vector<double>& to) {
    std::ranges::copy(from, to.begin() + static_cast<std::ptrdiff_t>(i * from.size()));
  };
  copy(solution.z, result.z);
  if (!controls_.multipliers) return;
  copy(solution.equality_multipliers, result.equality_multipliers);
  copy(solution.inequality_multipliers, result.inequality_multipliers);
  copy(solution.complementarity_multipliers_L, result.complementarity_multipliers_L);
  copy(solution.complementarity_multipliers_R, result.complementarity_multipliers_R);
}

BatchSolver::BatchSolver(std::unique_ptr<State> state) : state_(std::move(state)) {}
BatchSolver::BatchSolver(BatchSolver&&) noexcept = default;
BatchSolver& BatchSolver::operator=(BatchSolver&&) noexcept = default;
BatchSolver::~BatchSolver() = default;

Expected<BatchSolver> BatchSolver::create(const Problem& problem, const Options& options,
                                          const SetupControls& controls) {
  MARBLE_RETURN_IF_ERROR(validate_without_explain(options));
  MARBLE_ASSIGN_OR_RETURN(auto first, Solver::create(problem, options, controls));
  auto state = std::make_unique<State>();
  state->pattern = owned(problem.view());
  state->sizes = PartSizes::of(problem);
  state->options = options;
  state->limits.most_bytes = controls.most_bytes;
  state->limits.most_factorization_s = controls.most_factorization_s;
  state->limits.reference_methods = controls.reference_methods;
  state->solvers.emplace_back(std::move(first));
  return BatchSolver(std::move(state));
}

Expected<BatchResult> BatchSolver::solve(const BatchNumbers& numbers, const BatchSolverControls& controls) {
  MARBLE_RETURN_IF_ERROR(check_numbers(numbers, state_->sizes));
  if (controls.threads < 0 || controls.threads > most_threads)
    return unexpected(invalid("threads", std::to_string(controls.threads),
                              "must be in [0, " + std::to_string(most_threads) + "]"));
  if (controls.start != nullptr) {
    MARBLE_RETURN_IF_ERROR(check_start(*controls.start, numbers.count, state_->sizes));
  }
  std::size_t threads = controls.threads > 0 ? static_cast<std::size_t>(controls.threads)
                                             : std::max(1U, std::thread::hardware_concurrency());
  threads = std::clamp(threads, std::size_t{1}, std::max(std::size_t{1}, numbers.count));
  return or_out_of_memory([&]() -> Expected<BatchResult> {
    if (state_->solvers.size() < threads) state_->solvers.resize(threads);
    Batch batch(*state_, numbers, controls);
    if (!batch.run(threads)) return unexpected(out_of_memory());
    return std::move(batch.result);
  });
}

std::int64_t BatchSolver::memory_bytes() const {
  std::int64_t bytes = 0;
  for (const auto& solver : state_->solvers) bytes += solver ? solver->memory_bytes() : 0;
  return bytes;
}

const PartSizes& BatchSolver::sizes() const { return state_->sizes; }

}  // namespace marble
