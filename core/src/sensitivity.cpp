#include "marble/sensitivity.h"

#include <string>
#include <utility>

#include "branch/branch_derivatives.h"
#include "marble/solver.h"

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

}  // namespace

struct Sensitivity::State {
  State(const Problem& problem, ScaledProblem scaled_problem)
      : sizes(PartSizes::of(problem)),
        scaled(std::move(scaled_problem)),
        kkt(make_kkt(scaled)),
        point(scaled, *kkt),
        derivatives(scaled, sizes, point) {}

  template <class Work>
  auto counted(const Work& work) {
    Run run(kOptions, kNoControls);
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
  BranchPoint point;
  BranchDerivatives derivatives;
  std::int32_t factorizations = 0;
};

Sensitivity::Sensitivity(std::unique_ptr<State> state) : state_(std::move(state)) {}
Sensitivity::Sensitivity(Sensitivity&&) noexcept = default;
Sensitivity& Sensitivity::operator=(Sensitivity&&) noexcept = default;
Sensitivity::~Sensitivity() = default;

Expected<Sensitivity> Sensitivity::create(const Problem& problem, const Solution& answer) {
  if (auto valid = check_answer(answer, PartSizes::of(problem)); !valid) return unexpected(valid.error());
  auto state = std::make_unique<State>(problem, scale(problem, kOptions.scaling_passes));
  if (auto begun = state->begin(answer); !begun) return unexpected(begun.error());
  return Sensitivity(std::move(state));
}

Expected<void> Sensitivity::renew(const ProblemUpdate& update, const Solution& answer) {
  if (auto valid = state_->sizes.check(update); !valid) return valid;
  if (auto valid = check_answer(answer, state_->sizes); !valid) return valid;
  if (rescale(update, state_->scaled)) state_->kkt->load(state_->scaled);
  return state_->begin(answer);
}

Expected<AnswerChange> Sensitivity::along(const ProblemUpdate& direction) {
  if (auto valid = state_->sizes.check(direction); !valid)
    return unexpected(inside("direction", valid.error()));
  auto changes = state_->counted([&](Run& run) { return state_->derivatives.along(run, {1, direction}); });
  if (!changes) return unexpected(changes.error());
  if (!changes->missing.empty()) {
    return unexpected(
        failure(ErrorCode::failed_precondition, "direction",
                "the rows of the answer's branch contradict each other along it, or it is flat"));
  }
  return AnswerChange{std::move(changes->z),
                      std::move(changes->equality_multipliers),
                      std::move(changes->inequality_multipliers),
                      std::move(changes->complementarity_multipliers_L),
                      std::move(changes->complementarity_multipliers_R),
                      changes->holds[0] != 0};
}

Expected<ProblemGradient> Sensitivity::gradient(const AnswerWeights& weights) {
  if (auto valid = check(weights, state_->sizes); !valid) return unexpected(inside("weights", valid.error()));
  auto gradients = state_->counted([&](Run& run) {
    return state_->derivatives.gradients(run, {1, weights});
  });
  if (!gradients) return unexpected(gradients.error());
  if (!gradients->missing.empty()) {
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
  if (auto valid = check({.rows = request}, state_->sizes); !valid) return unexpected(valid.error());
  return state_->counted([&](Run& run) { return state_->derivatives.rows(run, request); });
}

Expected<SensitivityAnswer> Sensitivity::answer(const SensitivityRequest& request) {
  if (auto valid = check(request, state_->sizes); !valid) return unexpected(valid.error());
  const std::int32_t factors = factorizations(), solves = back_substitutions();
  auto answer = state_->counted([&](Run& run) { return state_->derivatives.answer(run, request); });
  if (!answer) return answer;
  answer->factorizations = factorizations() - factors;
  answer->back_substitutions = back_substitutions() - solves;
  return answer;
}

const std::vector<Index>& Sensitivity::weak_inequalities() const {
  return state_->derivatives.weak_inequalities();
}
const std::vector<Index>& Sensitivity::biactive_pairs() const { return state_->derivatives.biactive_pairs(); }
std::int32_t Sensitivity::factorizations() const { return state_->factorizations; }
std::int32_t Sensitivity::back_substitutions() const { return state_->point.back_substitutions(); }

}  // namespace marble
