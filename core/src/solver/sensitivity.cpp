#include "marble/sensitivity.h"

#include <string>
#include <utility>

#include "branch/branch_derivatives.h"
#include "marble/solver.h"
#include "model/tuning.h"

namespace marble {
namespace {

const Options kOptions;
const SolveControls kNoControls;

Expected<void> check_answer(const Solution& answer, const PartSizes& sizes) {
  if (auto valid = check_warm_start(answer, sizes); !valid) {
    const std::string& field = valid.error().field;
    return unexpected(of_field("solution" + field.substr(field.find('.')), valid.error()));
  }
  return must_be_solved(answer.status);
}

// The scaled copy, and the vectors of the branch and of a few directions.
double bytes_without_factor(const Problem& problem) {
  const PartSizes sizes = PartSizes::of(problem);
  const auto entries = static_cast<double>(sizes.Q + sizes.A + sizes.C + sizes.L + sizes.R);
  const auto vectors = static_cast<double>(sizes.g + sizes.b + sizes.d + sizes.l + sizes.r);
  return entries * (sizeof(double) + 2.0 * sizeof(Index)) +
         tuning::memory_iterates * vectors * sizeof(double);
}

}  // namespace

struct Sensitivity::State {
  State(const Problem& problem, ScaledProblem scaled_problem, std::unique_ptr<Kkt> made,
        const Interrupt& until)
      : sizes(PartSizes::of(problem)),
        scaled(std::move(scaled_problem)),
        kkt(std::move(made)),
        interrupt(until),
        point(scaled, *kkt),
        derivatives(scaled, sizes, point) {
    kkt->attend(interrupt);
  }

  template <class Work>
  auto counted(const Work& work) {
    Run run(kOptions, kNoControls, interrupt);
    auto result = work(run);
    factorizations += run.factorizations;
    return result;
  }

  Expected<void> begin(const Solution& answer) {
    Iterate solution(scaled);
    take(scaled, answer, solution);
    return counted([&](Run& run) { return derivatives.begin(run, solution, false); });
  }

  PartSizes sizes;
  ScaledProblem scaled;
  std::unique_ptr<Kkt> kkt;
  Interrupt interrupt;
  BranchPoint point;
  BranchDerivatives derivatives;
  std::int64_t memory_bytes = 0;
  std::int32_t factorizations = 0;
};

Sensitivity::Sensitivity(std::unique_ptr<State> state) : state_(std::move(state)) {}
Sensitivity::Sensitivity(Sensitivity&&) noexcept = default;
Sensitivity& Sensitivity::operator=(Sensitivity&&) noexcept = default;
Sensitivity::~Sensitivity() = default;

Expected<Sensitivity> Sensitivity::create(const Problem& problem, const Solution& answer) {
  return create(problem, answer, {});
}

Expected<Sensitivity> Sensitivity::create(const Problem& problem, const Solution& answer,
                                          const SetupControls& controls) {
  MARBLE_RETURN_IF_ERROR(check_answer(answer, PartSizes::of(problem)));
  const Interrupt interrupt(controls.stop, controls.until, controls.pause);
  const double own = bytes_without_factor(problem), limit = static_cast<double>(controls.most_bytes);
  const auto refuse = [&](double bytes) {
    return unexpected(failure(ErrorCode::resource_exhausted, "problem",
                              std::to_string(static_cast<std::int64_t>(bytes)) + " bytes of memory",
                              "derivatives may take at most " + std::to_string(controls.most_bytes)));
  };
  if (own > limit) return refuse(own);
  ScaledProblem scaled = scale(problem, kOptions.scaling_passes, interrupt);
  KktCost least;
  auto kkt = make_kkt(scaled, {limit - own, KktCost{}.flops}, interrupt, least);
  if (kkt == nullptr) {
    return interrupt.requested()
               ? unexpected(failure(ErrorCode::failed_precondition, "solution", "the run is over"))
               : refuse(own + least.bytes);
  }
  auto state = std::make_unique<State>(problem, std::move(scaled), std::move(kkt), interrupt);
  state->memory_bytes = static_cast<std::int64_t>(own + state->kkt->bytes());
  MARBLE_RETURN_IF_ERROR(state->begin(answer));
  return Sensitivity(std::move(state));
}

Expected<void> Sensitivity::renew(const ProblemUpdate& update, const Solution& answer) {
  MARBLE_RETURN_IF_ERROR(state_->sizes.check(update));
  MARBLE_RETURN_IF_ERROR(check_answer(answer, state_->sizes));
  const bool changed = rescale(update, state_->scaled);
  if (refit_scaling(state_->scaled, kOptions.scaling_passes, changed) || changed)
    state_->kkt->load(state_->scaled);
  return state_->begin(answer);
}

Expected<AnswerChange> Sensitivity::along(const ProblemUpdate& direction) {
  if (auto valid = state_->sizes.check(direction); !valid)
    return unexpected(inside("direction", valid.error()));
  auto changes = state_->counted([&](Run& run) { return state_->derivatives.along(run, {1, direction}); });
  if (!changes) return unexpected(changes.error());
  if (!changes->undefined.empty()) {
    return unexpected(
        failure(ErrorCode::failed_precondition, "direction",
                "the rows of the answer's branch contradict each other along it, or it is flat"));
  }
  return AnswerChange{std::move(changes->z),
                      std::move(changes->equality_multipliers),
                      std::move(changes->inequality_multipliers),
                      std::move(changes->complementarity_multipliers_L),
                      std::move(changes->complementarity_multipliers_R),
                      changes->active_set_constant[0] != 0};
}

Expected<ProblemGradient> Sensitivity::gradient(const AnswerWeights& weights) {
  if (auto valid = check(weights, state_->sizes); !valid) return unexpected(inside("weights", valid.error()));
  auto gradients = state_->counted([&](Run& run) {
    return state_->derivatives.gradients(run, {1, weights});
  });
  if (!gradients) return unexpected(gradients.error());
  if (!gradients->undefined.empty()) {
    return unexpected(failure(ErrorCode::failed_precondition, "weights",
                              "the multipliers of the answer's branch are not unique, or it is flat"));
  }
  ProblemGradient gradient;
#define MARBLE_VECTOR(letter, field) gradient.letter = std::move(gradients->letter);
#define MARBLE_MATRIX(letter, field, values, vector) gradient.letter = std::move(gradients->letter);
#include "marble/contract.def"
  return gradient;
}

Expected<RowResponse> Sensitivity::rows(const RowsRequest& request) {
  MARBLE_RETURN_IF_ERROR(check({.rows = request}, state_->sizes));
  return state_->counted([&](Run& run) { return state_->derivatives.rows(run, request); });
}

Expected<SensitivityAnswer> Sensitivity::answer(const SensitivityRequest& request) {
  MARBLE_RETURN_IF_ERROR(check(request, state_->sizes));
  const std::int32_t factors = factorizations(), solves = back_substitutions();
  MARBLE_ASSIGN_OR_RETURN(
      auto answer, state_->counted([&](Run& run) { return state_->derivatives.answer(run, request); }));
  answer.factorizations = factorizations() - factors;
  answer.back_substitutions = back_substitutions() - solves;
  return answer;
}

std::int64_t Sensitivity::memory_bytes() const { return state_->memory_bytes; }
const std::vector<Index>& Sensitivity::weak_inequalities() const {
  return state_->derivatives.weak_inequalities();
}
const std::vector<Index>& Sensitivity::biactive_pairs() const { return state_->derivatives.biactive_pairs(); }
std::int32_t Sensitivity::factorizations() const { return state_->factorizations; }
std::int32_t Sensitivity::back_substitutions() const { return state_->point.back_substitutions(); }

}  // namespace marble
