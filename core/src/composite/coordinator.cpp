// ALADIN (Houska, Frasch and Diehl 2016) with exact Hessians and active sets. Each block minimizes its own
// cost plus a price on its coupling rows and a proximal term. Then one dense system makes the blocks agree,
//
//   (Σ S_k + δI) λ⁺ = Σ (E_k y_k + S_k μ_k) − e + δλ,   E_k z_k = E_k y_k + S_k (μ_k − λ⁺),
//
// with μ_k = λ + ρE_k(y_k − z_k⁻), the price at which the block would choose y_k without the proximal term.
// This is Newton's step. It is too long if another active set begins on the way. The step of the alternating
// direction method of multipliers (Boyd et al. 2011, section 5),
//
//   λ⁺ = λ + ρv,   E_k z_k = E_k y_k − v,
//
// with v the violation of a row divided by the number of blocks that contain it, makes convex blocks agree
// from any start, but slowly. Once the pairs are frozen, a step that did not help is repeated closer to this
// one. If frozen sides leave rows that nothing moves, ΣS_k is singular and no price helps. Then pairs whose
// fixed side has a wrong-sign multiplier switch sides, one by one.
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "composite/dense.h"
#include "composite/finish.h"
#include "marble/composite/coupled.h"
#include "model/linear_algebra.h"
#include "model/text_of.h"
#include "model/tuning.h"

namespace marble {
namespace {

class Coordinator {
 public:
  Coordinator(BlockTicks& blocks, std::span<const double> coupling_rhs, const CoupledOptions& options,
              const CoupledControls& controls)
      : blocks_(blocks),
        options_(options),
        controls_(controls),
        coupling_rhs_(
            Eigen::Map<const Vector>(coupling_rhs.data(), static_cast<Eigen::Index>(coupling_rhs.size()))),
        interrupt_(interrupt_of(controls, options.options)),
        state_{.coupling_multipliers = Vector::Zero(coupling_rhs_.size()),
               .asks = {},
               .answers = {},
               .last = {}},
        proximal_(options.proximal) {
    if (controls.start != nullptr && !controls.start->coupling_multipliers.empty())
      state_.coupling_multipliers =
          Eigen::Map<const Vector>(controls.start->coupling_multipliers.data(), coupling_rhs_.size());
    for (std::size_t k = 0; k < blocks.rows().size(); ++k) {
      BlockAsk& ask = state_.asks.emplace_back();
      for (const Index row : blocks.rows()[k]) ask.price.push_back(state_.coupling_multipliers[row]);
      ask.proximal = proximal_;
      ask.centre = blocks.start(k);
      ask.centre.resize(ask.price.size(), 0.0);
    }
  }

  [[nodiscard]] Expected<Coordination> run();

 private:
  enum class End { agreed, not_yet, failed, stopped };
  // State to return to if a switch does not help.
  struct State {
    Vector coupling_multipliers;
    std::vector<BlockAsk> asks;
    std::vector<BlockAnswer> answers;  // without their responses
    CoupledIteration last;
    std::shared_ptr<const std::vector<std::vector<double>>> responses =
        {};  // of the answers; dense, so shared
  };

  [[nodiscard]] Expected<bool> tick();
  [[nodiscard]] Expected<End> iterate(int most, bool may_unblock = false);
  [[nodiscard]] bool frozen() const { return state_.asks.front().frozen; }
  [[nodiscard]] bool may_go_back() const;
  [[nodiscard]] Expected<bool> search();
  [[nodiscard]] bool failed();
  [[nodiscard]] bool measure();
  using Pair = std::pair<std::size_t, Index>;  // block, and pair of this block
  [[nodiscard]] bool unblock();
  void block_again();
  [[nodiscard]] State without_responses() const;
  [[nodiscard]] bool go_back(const State& best);
  [[nodiscard]] bool agree();
  [[nodiscard]] Expected<void> try_switches();
  [[nodiscard]] Coordination ended(Status status, std::string detail);

  BlockTicks& blocks_;
  const CoupledOptions& options_;
  const CoupledControls& controls_;
  Vector coupling_rhs_;
  Interrupt interrupt_;
  State state_;
  Coordination result_;
  double proximal_;
  int raises_ = 0;
  double newton_ = 1.0;  // 1: Newton's step; towards 0: the averaging step
  int gains_ = 0;        // number of best iterations since newton_ last changed
  bool rows_hold_ = false;
  bool blocked_ = false;                        // no price changes the remaining violation of the rows
  std::vector<Pair> unblocked_;                 // pairs that were switched for this reason
  std::optional<State> before_, first_before_;  // states before the last and the first of these
  std::int32_t iterations_ = 0;
  std::int64_t factorizations_ = 0;
};

// Solves all blocks once. Returns false if one failed.
Expected<bool> Coordinator::tick() {
  state_.responses.reset();
  MARBLE_ASSIGN_OR_RETURN(state_.answers, blocks_.tick(state_.asks));
  std::vector<std::vector<double>> responses;
  for (BlockAnswer& answer : state_.answers) responses.push_back(std::move(answer.response));
  state_.responses = std::make_shared<const std::vector<std::vector<double>>>(std::move(responses));
  ++iterations_;
  for (BlockAsk& ask : state_.asks) ask.switched_pairs.clear(), ask.search = false;
  for (const BlockAnswer& answer : state_.answers) factorizations_ += answer.factorizations;
  return !failed();
}

// Solves all blocks until they agree. If they move apart, or a price makes a block infeasible, continues more
// cautiously from the best iteration.
Expected<Coordinator::End> Coordinator::iterate(int most, bool may_unblock) {
  double best_apart = std::numeric_limits<double>::infinity();
  State best;
  int since_best = 0;
  for (int i = 0; i < most; ++i) {
    MARBLE_ASSIGN_OR_RETURN(const auto solved, tick());
    const bool agreed = solved && measure();
    if (controls_.activity != nullptr)
      controls_.activity->set_done(Phase::coupled, iterations_, options_.max_iterations);
    if (solved && controls_.progress) controls_.progress(state_.last);
    if (agreed) return End::agreed;
    const double apart = solved ? std::max(state_.last.coupling_violation, state_.last.step / proximal_)
                                : std::numeric_limits<double>::infinity();
    if (!solved && before_) {
      block_again();
      continue;
    }
    before_.reset();
    ++since_best;
    if (apart < best_apart) {
      best_apart = apart, best = state_, since_best = 0;
      if (newton_ < 1.0 && ++gains_ >= tuning::coupled_gains) {
        newton_ = std::min(1.0, 2.0 * newton_);
        gains_ = 0;
      }
    }
    const bool idle = frozen() && since_best >= tuning::short_patience;
    const bool apart_again = !(apart <= tuning::coupled_apart * best_apart);
    if ((idle || apart_again) && !best.asks.empty() && may_go_back()) {
      if (!go_back(best)) return End::stopped;
      since_best = 0;
      continue;
    }
    if (!solved) return End::failed;
    if (!agree()) return End::stopped;
    if (blocked_ && may_unblock && unblock()) {
      best = {}, best_apart = std::numeric_limits<double>::infinity();
      since_best = 0;
    }
  }
  return End::not_yet;
}

// Returns to the best iteration. Frozen blocks are convex, so the step from there is taken closer to the
// averaging step. If that does not help either, or if blocks with free pairs jump, the proximal term is
// raised.
bool Coordinator::go_back(const State& best) {
  const bool failed = result_.failed_block.has_value();
  result_.failed_block.reset();
  state_ = best;
  gains_ = 0;
  if ((frozen() || !failed) && newton_ > tuning::coupled_least_step) {
    newton_ *= 0.5;
    return agree();
  }
  ++raises_;
  newton_ = 1.0;
  proximal_ *= tuning::penalty_factor;
  for (BlockAsk& ask : state_.asks) ask.proximal = proximal_;
  return true;
}

// A state from which the blocks are solved again needs no responses.
Coordinator::State Coordinator::without_responses() const {
  return {.coupling_multipliers = state_.coupling_multipliers,
          .asks = state_.asks,
          .answers = state_.answers,
          .last = state_.last};
}

// A block's proof holds at any price, and a stop is final.
bool Coordinator::may_go_back() const {
  if (raises_ >= tuning::coupled_raises) return false;
  if (!result_.failed_block) return true;
  const Status status = state_.answers[*result_.failed_block].status;
  return iterations_ > 1 && (status == Status::locally_infeasible || status == Status::numerical_failure);
}

// Lets each block search for a better branch at the coupling_multipliers on which they agree. Returns true if
// one improved.
Expected<bool> Coordinator::search() {
  const State agreed = without_responses();
  const auto back = [&] {
    result_.failed_block.reset();
    state_ = agreed;
    return false;
  };
  for (BlockAsk& ask : state_.asks) ask.search = true;
  MARBLE_ASSIGN_OR_RETURN(const auto solved, tick());
  if (!solved) return back();
  const bool stayed = measure();
  if (controls_.progress) controls_.progress(state_.last);
  if (stayed) return false;
  if (!agree()) return back();
  MARBLE_ASSIGN_OR_RETURN(const auto end, iterate(options_.freeze_after));
  const double gain = agreed.last.objective - state_.last.objective;
  const double least = tuning::exactness * (1.0 + std::abs(agreed.last.objective));
  if (end != End::agreed || gain <= least) return back();
  return true;
}

bool Coordinator::failed() {
  for (std::size_t k = 0; k < state_.answers.size(); ++k) {
    if (is_solved(state_.answers[k].status)) continue;
    result_.failed_block = k;
    return true;
  }
  return false;
}

// Measures how far the blocks are from agreement. Returns true if they agree within the tolerance.
bool Coordinator::measure() {
  Vector sum = -coupling_rhs_;
  double step = 0.0, objective = 0.0, value = max_abs(coupling_rhs_);
  for (std::size_t k = 0; k < state_.answers.size(); ++k) {
    const BlockAnswer& answer = state_.answers[k];
    const std::vector<Index>& rows = blocks_.rows()[k];
    objective += answer.objective;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      sum[rows[i]] += answer.value[i];
      value = std::max(value, std::abs(answer.value[i]));
      step = std::max(step, proximal_ * std::abs(answer.value[i] - state_.asks[k].centre[i]));
    }
  }
  state_.last = {iterations_, max_abs(sum), step, objective, proximal_, frozen(), factorizations_};
  rows_hold_ = state_.last.coupling_violation <= options_.tolerance * (1.0 + value);
  return rows_hold_ && step <= options_.tolerance * (1.0 + max_abs(state_.coupling_multipliers));
}

// Returns false if interrupted; then nothing has changed.
bool Coordinator::agree() {
  const Eigen::Index m = coupling_rhs_.size();
  Checkpoint checkpoint(interrupt_);
  Eigen::MatrixXd responses = Eigen::MatrixXd::Zero(m, m);
  Vector violation = -coupling_rhs_, right = -coupling_rhs_, seen_by = Vector::Zero(m);
  std::vector<Vector> own_coupling_multipliers;
  for (std::size_t k = 0; k < state_.answers.size(); ++k) {
    const BlockAnswer& answer = state_.answers[k];
    const BlockAsk& ask = state_.asks[k];
    const std::vector<Index>& rows = blocks_.rows()[k];
    const std::size_t m_k = rows.size();
    const std::vector<double>& response = (*state_.responses)[k];
    if (checkpoint.reached(static_cast<std::int64_t>(m_k * m_k))) return false;
    Vector& mu = own_coupling_multipliers.emplace_back(static_cast<Eigen::Index>(m_k));
    for (std::size_t i = 0; i < m_k; ++i)
      mu[static_cast<Eigen::Index>(i)] = ask.price[i] + proximal_ * (answer.value[i] - ask.centre[i]);
    for (std::size_t i = 0; i < m_k; ++i) {
      seen_by[rows[i]] += 1.0;
      violation[rows[i]] += answer.value[i];
      right[rows[i]] += answer.value[i];
      for (std::size_t j = 0; j < m_k; ++j) {
        const double entry = response[j * m_k + i];
        responses(rows[i], rows[j]) += entry;
        right[rows[i]] += entry * mu[static_cast<Eigen::Index>(j)];
      }
    }
  }
  const double least = tuning::rounding * std::max(tuning::zero, max_abs(responses.diagonal()));
  responses.diagonal().array() += least;
  right += least * state_.coupling_multipliers;
  Vector newton = right;
  if (!solve_semidefinite(responses, newton, interrupt_)) return false;
  const Vector share = violation.cwiseQuotient(seen_by.cwiseMax(1.0));
  const double left =
      least * max_abs(newton - state_.coupling_multipliers);  // part of the violation after Newton's step
  blocked_ = !rows_hold_ && left > tuning::coupled_blocked * max_abs(violation);
  const double way = blocked_ ? 0.0 : newton_;
  state_.coupling_multipliers =
      (1.0 - way) * (state_.coupling_multipliers + proximal_ * share) + way * newton;
  for (std::size_t k = 0; k < state_.answers.size(); ++k) {
    const BlockAnswer& answer = state_.answers[k];
    BlockAsk& ask = state_.asks[k];
    const std::vector<Index>& rows = blocks_.rows()[k];
    const std::size_t m_k = rows.size();
    const std::vector<double>& response = (*state_.responses)[k];
    for (std::size_t i = 0; i < m_k; ++i) ask.price[i] = state_.coupling_multipliers[rows[i]];
    for (std::size_t i = 0; i < m_k; ++i) {
      double change = 0.0;
      for (std::size_t j = 0; j < m_k; ++j)
        change += response[j * m_k + i] *
                  (own_coupling_multipliers[k][static_cast<Eigen::Index>(j)] - newton[rows[j]]);
      ask.centre[i] = answer.value[i] - (1.0 - way) * share[rows[i]] + way * change;
    }
  }
  return true;
}

// Switches the pair whose fixed side has the largest wrong-sign multiplier, and only in its block, because
// equal blocks all chose the same side. Returns false if no pair has one, or if the limit of switches is
// reached.
bool Coordinator::unblock() {
  if (std::ssize(unblocked_) >= options_.max_pair_switches) return false;
  std::optional<Pair> hardest;
  double pull = tuning::near;
  for (std::size_t k = 0; k < state_.answers.size(); ++k) {
    const Solution& own = state_.answers[k].solution;
    for (std::size_t i = 0; i < own.complementarity_multipliers_L.size(); ++i) {
      const double here =
          -std::min(own.complementarity_multipliers_L[i], own.complementarity_multipliers_R[i]);
      const Pair pair(k, static_cast<Index>(i));
      if (here <= pull || std::ranges::find(unblocked_, pair) != unblocked_.end()) continue;
      pull = here, hardest = pair;
    }
  }
  if (!hardest) return false;
  before_ = without_responses();
  if (!first_before_) first_before_ = before_;
  unblocked_.push_back(*hardest);
  state_.asks[hardest->first].switched_pairs.push_back(hardest->second);
  ++result_.pair_switches;
  return true;
}

// Undoes the last switch, with which its block has no solution.
void Coordinator::block_again() {
  const auto [block, pair] = unblocked_.back();
  state_ = *std::exchange(before_, std::nullopt);
  state_.asks[block].switched_pairs.push_back(pair);
  result_.failed_block.reset();
  --result_.pair_switches;
}

// Tries to switch pairs whose fixed side has a wrong-sign multiplier, the largest first. Keeps the first
// switch after which the blocks agree at a lower cost, and then considers all pairs again.
Expected<void> Coordinator::try_switches() {
  std::vector<Pair> undo;
  std::vector<Pair> tried;
  for (int left = options_.max_pair_switches; left > 0; --left) {
    std::optional<Pair> hardest;
    double pull = 0.0;
    for (std::size_t k = 0; k < state_.answers.size(); ++k) {
      for (const BlockPull& candidate : state_.answers[k].pulls) {
        const Pair pair(k, candidate.pair);
        if (candidate.pull <= pull || std::ranges::find(tried, pair) != tried.end()) continue;
        pull = candidate.pull, hardest = pair;
      }
    }
    if (!hardest) break;
    tried.push_back(*hardest);
    State before = without_responses();
    for (const auto& [block, pair] : undo) state_.asks[block].switched_pairs.push_back(pair);
    undo.clear();
    state_.asks[hardest->first].switched_pairs.push_back(hardest->second);
    MARBLE_ASSIGN_OR_RETURN(auto end, iterate(options_.freeze_after));
    const double gain = before.last.objective - state_.last.objective;
    if (end == End::agreed && gain > tuning::exactness * (1.0 + std::abs(before.last.objective))) {
      ++result_.pair_switches;
      tried.clear();
      continue;
    }
    result_.failed_block.reset();
    state_ = std::move(before);
    if (interrupt_.requested()) break;
    undo.push_back(*hardest);
  }
  return {};
}

Coordination Coordinator::ended(Status status, std::string detail) {
  result_.status = status;
  result_.detail = std::move(detail);
  result_.coupling_multipliers.assign(state_.coupling_multipliers.begin(), state_.coupling_multipliers.end());
  result_.answers = std::move(state_.answers);
  result_.last = state_.last;
  result_.last.iteration = iterations_;
  result_.last.factorizations = factorizations_;
  return std::move(result_);
}

Expected<Coordination> Coordinator::run() {
  Expected<End> end = End::not_yet;
  if (options_.freeze_after > 0) end = iterate(std::min(options_.freeze_after, options_.max_iterations));
  for (int i = 0; end && *end == End::agreed && i < options_.max_searches; ++i) {
    MARBLE_ASSIGN_OR_RETURN(const auto gained, search());
    if (!gained) break;
  }
  if (end && *end == End::not_yet && iterations_ < options_.max_iterations) {
    for (BlockAsk& ask : state_.asks) ask.frozen = true;
    result_.frozen_at = iterations_ + 1;
    end = iterate(options_.max_iterations - iterations_, true);
    if (end && *end == End::not_yet && first_before_) {  // the switches did not help
      state_ = *std::move(first_before_);
      result_.pair_switches = 0;
    }
  }
  if (!end) return unexpected(end.error());
  if (*end == End::stopped) {
    return ended(interrupt_.stop_requested() ? Status::cancelled : Status::time_limit,
                 "ended after " + std::to_string(iterations_) + " iterations of the blocks");
  }
  if (*end == End::failed) {
    const std::size_t block = *result_.failed_block;
    const BlockAnswer& answer = state_.answers[block];
    return ended(answer.status,
                 blocks_.name(block) + " is " + to_string(answer.status) + " by itself: " + answer.detail);
  }
  if (*end == End::agreed && result_.frozen_at > 0) {
    MARBLE_RETURN_IF_ERROR(try_switches());
  }
  const std::string numbers = "coupling rows hold to " + scientific(state_.last.coupling_violation, 1) +
                              " after " + std::to_string(iterations_) + " iterations";
  if (*end != End::agreed) return ended(Status::iteration_limit, "the blocks do not agree yet: " + numbers);
  for (std::size_t k = 0; k < state_.answers.size(); ++k) {
    if (state_.answers[k].status == Status::almost_solved) {
      return ended(Status::almost_solved, "the blocks agree: " + numbers + "; " + blocks_.name(k) +
                                              " is almost solved: " + state_.answers[k].detail);
    }
  }
  return ended(Status::solved, "the blocks agree: " + numbers);
}

}  // namespace

Expected<void> CoupledOptions::check() const {
  if (auto valid = validate_without_explain(options); !valid)
    return unexpected(inside("options", valid.error()));
  if (!(proximal > 0.0) || !std::isfinite(proximal))
    return unexpected(invalid("proximal", general(proximal, 6), "must be > 0 and finite"));
  if (max_iterations < 1)
    return unexpected(invalid("max_iterations", std::to_string(max_iterations), "must be >= 1"));
  if (freeze_after < 0)
    return unexpected(invalid("freeze_after", std::to_string(freeze_after), "must be >= 0"));
  if (max_searches < 0)
    return unexpected(invalid("max_searches", std::to_string(max_searches), "must be >= 0"));
  if (max_pair_switches < 0)
    return unexpected(invalid("max_pair_switches", std::to_string(max_pair_switches), "must be >= 0"));
  if (!(tolerance > 0.0 && tolerance < 1.0))
    return unexpected(invalid("tolerance", general(tolerance, 6), "must be in (0, 1)"));
  return {};
}

Expected<Coordination> coordinate(BlockTicks& blocks, std::span<const double> coupling_rhs,
                                  const CoupledOptions& options, const CoupledControls& controls) {
  MARBLE_RETURN_IF_ERROR(options.check());
  if (coupling_rhs.size() > static_cast<std::size_t>(kMostCouplingRows)) {
    return unexpected(invalid("coupling_rhs", std::to_string(coupling_rhs.size()),
                              "rows tie the blocks; must be at most " + std::to_string(kMostCouplingRows)));
  }
  MARBLE_RETURN_IF_ERROR(check_numbers(coupling_rhs, coupling_rhs.size(), "coupling_rhs"));
  if (controls.start != nullptr && !controls.start->coupling_multipliers.empty()) {
    MARBLE_RETURN_IF_ERROR(check_numbers(controls.start->coupling_multipliers, coupling_rhs.size(),
                                         "start.coupling_multipliers"));
  }
  const bool knows_sides = controls.start != nullptr && !controls.start->blocks.empty();
  if (options.freeze_after == 0 && !knows_sides)
    return unexpected(invalid("freeze_after", "0", "must be >= 1 without a start that knows the sides"));
  const PhaseScope phase(controls.activity, Phase::coupled, options.max_iterations);
  return or_out_of_memory([&] { return Coordinator(blocks, coupling_rhs, options, controls).run(); });
}

}  // namespace marble
