#include "composite/lifted_blocks.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "composite/finish.h"
#include "marble/sensitivity.h"
#include "marble/solver.h"
#include "model/entries.h"
#include "model/tuning.h"
#include "path/run_tasks.h"

namespace marble {
namespace {

class SolverHere final : public BlockSolver {
 public:
  SolverHere(const Options& options, const CoupledControls& controls, MemoryBudget& memory,
             const LiftedBlock& block)
      : options_(options), controls_(controls), memory_(memory), block_(block) {}
  SolverHere(const SolverHere&) = delete;
  SolverHere& operator=(const SolverHere&) = delete;
  ~SolverHere() override {
    if (solver_) memory_.give_back(solver_->memory_bytes());
  }

  Expected<Solution> solve(const ProblemUpdate& update, const Solution* start) override {
    if (solver_) {
      MARBLE_RETURN_IF_ERROR(solver_->update(update));
    } else {
      MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(block_.problem().view()));
      auto made = memory_.make([&](std::int64_t bytes) {
        SetupControls setup = setup_of(controls_, options_);
        setup.most_bytes = bytes;
        return Solver::create(problem, options_, setup);
      });
      if (!made) return unexpected(made.error());
      solver_.emplace(*std::move(made));
    }
    return solver_->solve(
        {.stop = controls_.stop, .warm_start = start, .pause = controls_.pause, .begun = controls_.begun});
  }

 private:
  const Options& options_;
  const CoupledControls& controls_;
  MemoryBudget& memory_;
  const LiftedBlock& block_;
  std::optional<Solver> solver_;
};

// Returns the solution of a block's last solve, or zeros if there is none.
Solution unchanged(const LiftedBlock& block, const std::optional<Solution>& newest) {
  if (newest) return *newest;
  const OwnedProblem& p = block.problem();
  Solution zeros;
  zeros.z.assign(p.g.size(), 0.0);
  zeros.equality_multipliers.assign(p.b.size(), 0.0);
  zeros.inequality_multipliers.assign(p.d.size(), 0.0);
  zeros.complementarity_multipliers_L.assign(p.l.size(), 0.0);
  zeros.complementarity_multipliers_R.assign(p.l.size(), 0.0);
  return zeros;
}

}  // namespace

std::string block_name(const CoupledView& view, std::size_t block) {
  const std::string& name = view.blocks[block].name;
  return "block " + std::to_string(block) + (name.empty() ? "" : " (" + name + ")");
}

LiftedBlocks::LiftedBlocks(const CoupledView& view, const CoupledOptions& options,
                           const CoupledControls& controls)
    : view_(view),
      controls_(controls),
      options_(options.options),
      memory_(controls.setup.most_bytes),
      open_(controls.open) {
  if (!open_) {
    open_ = [this](const LiftedBlock& block) -> Expected<std::unique_ptr<BlockSolver>> {
      return std::make_unique<SolverHere>(options_, controls_, memory_, block);
    };
  }
  for (const CoupledBlock& block : view.blocks) {
    blocks_.push_back(std::make_unique<Block>(block));
    rows_.push_back(blocks_.back()->lifted.rows());
  }
  std::vector<double> coupling_multipliers =
      controls.start == nullptr ? std::vector<double>{} : controls.start->coupling_multipliers;
  coupling_multipliers.resize(view.coupling_rhs.size(), 0.0);
  if (controls.start == nullptr || controls.start->blocks.empty()) {
    begin_alone(coupling_multipliers);
    return;
  }
  for (std::size_t k = 0; k < blocks_.size(); ++k)
    blocks_[k]->newest = blocks_[k]->lifted.lifted(controls.start->blocks[k], coupling_multipliers);
}

// Without a start, a block begins at its own solution without a proximal term, because zero may be far from
// every point that it can reach. A block without a solution begins at zero nevertheless.
void LiftedBlocks::begin_alone(const std::vector<double>& coupling_multipliers) {
  const Interrupt interrupt = interrupt_of(controls_, options_);
  each([&](std::size_t k) {
    if (interrupt.requested()) return;
    Block& block = *blocks_[k];
    // The first iteration repeats any error of this solve and reports it.
    (void)or_out_of_memory([&]() -> Expected<void> {
      BlockAsk alone;
      alone.proximal = 0.0;
      for (const Index row : rows_[k]) alone.price.push_back(coupling_multipliers[at(row)]);
      alone.centre.resize(rows_[k].size(), 0.0);
      block.lifted.ask(alone);
      MARBLE_RETURN_IF_ERROR(open(block));
      MARBLE_ASSIGN_OR_RETURN(auto solution, block.solver->solve({}, nullptr));
      block.factorizations = solution.factorizations;
      if (is_solved(solution.status)) block.newest = std::move(solution);
      return {};
    });
  });
}

Expected<void> LiftedBlocks::open(Block& block) const {
  MARBLE_ASSIGN_OR_RETURN(block.solver, open_(block.lifted));
  return {};
}

void LiftedBlocks::each(const std::function<void(std::size_t)>& work) const {
  std::vector<std::function<void()>> tasks;
  for (std::size_t k = 0; k < blocks_.size(); ++k) tasks.emplace_back([&work, k] { work(k); });
  run_tasks(controls_.runner, tasks);
}

std::vector<double> LiftedBlocks::start(std::size_t block) const {
  const Block& b = *blocks_[block];
  if (!b.newest) return {};
  return {b.newest->z.begin() + b.lifted.variables(), b.newest->z.end()};
}

std::string LiftedBlocks::name(std::size_t block) const { return block_name(view_, block); }

Expected<BlockAnswer> LiftedBlocks::solve(Block& block, const BlockAsk& ask) {
  const Interrupt interrupt = interrupt_of(controls_, options_);
  const auto ended = [&](Solution where) {
    where.status = interrupt.stop_requested() ? Status::cancelled : Status::time_limit;
    where.detail = "ended before its solve";
    where.factorizations = std::exchange(block.factorizations, 0);
    return block.lifted.answer(std::move(where), {});
  };
  if (interrupt.requested()) return ended(unchanged(block.lifted, block.newest));
  if (ask.frozen && !block.lifted.frozen()) {
    block.newest = block.lifted.freeze(*block.newest);
    memory_.give_back(block.response.memory_bytes());
    block.solver.reset(), block.response.forget();
  }
  for (const Index pair : ask.switched_pairs) block.lifted.switch_pair(pair);
  block.lifted.ask(ask);
  const ProblemUpdate update = block.lifted.update();
  const bool fresh = block.solver == nullptr;
  if (fresh) {
    MARBLE_RETURN_IF_ERROR(open(block));
  }
  const Solution* const start = block.newest ? &*block.newest : nullptr;
  auto solution = block.solver->solve(fresh ? ProblemUpdate{} : update, start);
  if (!solution && ends_early(solution.error()) && interrupt.requested())
    return ended(unchanged(block.lifted, block.newest));
  if (solution && ask.search && start != nullptr) {
    auto cold = block.solver->solve({}, nullptr);
    if (!cold) return unexpected(cold.error());
    const int factorizations = solution->factorizations + cold->factorizations;
    const double least = tuning::near * (1.0 + std::abs(solution->objective));
    if (is_solved(cold->status) && !(cold->objective >= solution->objective - least))
      solution = std::move(cold);
    solution->factorizations = factorizations;
  }
  if (!solution) return unexpected(solution.error());
  solution->factorizations += std::exchange(block.factorizations, 0);
  if (!is_solved(solution->status)) return block.lifted.answer(*std::move(solution), {});
  block.newest = *solution;
  const SetupControls ends = setup_of(controls_, options_);
  const auto create = [&](const Problem& problem, const Solution& of) {
    return memory_.make([&](std::int64_t bytes) {
      SetupControls setup = ends;
      setup.most_bytes = bytes;
      return Sensitivity::create(problem, of, setup);
    });
  };
  MARBLE_ASSIGN_OR_RETURN(auto along, block.response.at(block.lifted, update, *solution, create, ends));
  BlockAnswer answer = block.lifted.answer(*solution, std::move(along), ends);
  if (!interrupt.requested()) return answer;
  block.factorizations = solution->factorizations;
  return ended(*std::move(solution));
}

Expected<std::vector<BlockAnswer>> LiftedBlocks::tick(std::span<const BlockAsk> asks) {
  std::vector<Expected<BlockAnswer>> answers(blocks_.size());
  each([&](std::size_t k) { answers[k] = or_out_of_memory([&] { return solve(*blocks_[k], asks[k]); }); });
  std::vector<BlockAnswer> result;
  for (std::size_t k = 0; k < answers.size(); ++k) {
    if (!answers[k]) return unexpected(inside("blocks[" + std::to_string(k) + "]", answers[k].error()));
    result.push_back(*std::move(answers[k]));
  }
  return result;
}

}  // namespace marble
