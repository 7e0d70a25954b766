#include "coupled/lifted_blocks.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <utility>

#include "coupled/entries.h"
#include "coupled/finish.h"
#include "data/interrupt.h"
#include "marble/solver.h"
#include "run/run_tasks.h"
#include "tuning.h"

namespace marble {
namespace {

// What all solvers of one coupled problem share.
struct Here {
  Here(const Options& solver_options, const CoupledControls& coupled)
      : options(solver_options), controls(coupled) {}
  const Options& options;
  const CoupledControls& controls;
  std::atomic<std::int64_t> bytes{0};  // of all of them
};

class SolverHere final : public BlockSolver {
 public:
  SolverHere(std::shared_ptr<Here> here, const LiftedBlock& block) : here_(std::move(here)), block_(block) {}
  SolverHere(const SolverHere&) = delete;
  SolverHere& operator=(const SolverHere&) = delete;
  ~SolverHere() override { here_->bytes -= bytes_; }

  Expected<Solution> solve(const ProblemUpdate& update, const Solution* start) override {
    const CoupledControls& controls = here_->controls;
    const SolveControls how{.stop = controls.stop, .warm_start = start, .begun = controls.begun};
    if (solver_) {
      if (auto taken = solver_->update(update); !taken) return unexpected(taken.error());
      return solver_->solve(how);
    }
    const auto problem = Problem::create(block_.problem().view());
    if (!problem) return unexpected(problem.error());
    const auto made = set_up(*problem);
    if (made) return solver_->solve(how);
    if (!ends_early(made.error())) return unexpected(made.error());
    return solve_once(*problem, here_->options, how);  // which ends the same way, with an answer
  }

 private:
  [[nodiscard]] Expected<void> set_up(const Problem& problem) {
    const CoupledControls& controls = here_->controls;
    SetupControls setup = controls.setup;
    setup.stop = controls.stop;
    setup.most_bytes = std::max<std::int64_t>(0, setup.most_bytes - here_->bytes);
    if (controls.begun) setup.until = after(*controls.begun, here_->options.time_limit_s);
    auto made = Solver::create(problem, here_->options, setup);
    if (!made) return unexpected(made.error());
    bytes_ = made->memory_bytes();
    if ((here_->bytes += bytes_) > controls.setup.most_bytes) {
      return unexpected(failure(ErrorCode::resource_exhausted, "problem",
                                "needs more memory with the other blocks than the " +
                                    std::to_string(controls.setup.most_bytes) + " bytes allowed"));
    }
    solver_.emplace(*std::move(made));
    return {};
  }

  std::shared_ptr<Here> here_;
  const LiftedBlock& block_;
  std::optional<Solver> solver_;
  std::int64_t bytes_ = 0;
};

OpenBlockSolver solvers_here(const CoupledOptions& options, const CoupledControls& controls) {
  return [here = std::make_shared<Here>(options.options, controls)](
             const LiftedBlock& block) -> Expected<std::unique_ptr<BlockSolver>> {
    return std::make_unique<SolverHere>(here, block);
  };
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
      open_(controls.open ? controls.open : solvers_here(options, controls)) {
  for (const CoupledBlock& block : view.blocks) {
    blocks_.push_back(std::make_unique<Block>(block));
    rows_.push_back(blocks_.back()->lifted.rows());
  }
  std::vector<double> prices = controls.start == nullptr ? std::vector<double>{} : controls.start->prices;
  prices.resize(view.total.size(), 0.0);
  if (controls.start == nullptr || controls.start->blocks.empty()) {
    begin_alone(prices);
    return;
  }
  for (std::size_t k = 0; k < blocks_.size(); ++k)
    blocks_[k]->newest = blocks_[k]->lifted.lifted(controls.start->blocks[k], prices);
}

// Where nothing is known a block begins at its own answer, not held anywhere: zero may be far from all that
// it can reach. One that has none begins there all the same.
void LiftedBlocks::begin_alone(const std::vector<double>& prices) {
  each([&](std::size_t k) {
    Block& block = *blocks_[k];
    // An error of it comes again in the first iteration, which tells it.
    (void)or_out_of_memory([&]() -> Expected<void> {
      BlockAsk alone;
      alone.proximal = 0.0;
      for (const Index row : rows_[k]) alone.price.push_back(prices[at(row)]);
      alone.centre.resize(rows_[k].size(), 0.0);
      block.lifted.ask(alone);
      if (auto opened = open(block); !opened) return opened;
      auto solution = block.solver->solve({}, nullptr);
      if (!solution) return unexpected(solution.error());
      block.factorizations = solution->factorizations;
      if (is_solved(solution->status)) block.newest = *std::move(solution);
      return {};
    });
  });
}

Expected<void> LiftedBlocks::open(Block& block) const {
  auto solver = open_(block.lifted);
  if (!solver) return unexpected(solver.error());
  block.solver = *std::move(solver);
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

Expected<BlockAnswer> LiftedBlocks::solve(Block& block, const BlockAsk& ask) const {
  if (ask.frozen && !block.lifted.frozen()) {
    block.newest = block.lifted.freeze(*block.newest);
    block.solver.reset(), block.response.forget();
  }
  for (const Index pair : ask.flips) block.lifted.flip(pair);
  block.lifted.ask(ask);
  const ProblemUpdate update = block.lifted.update();
  const bool fresh = block.solver == nullptr;
  if (fresh) {
    if (auto opened = open(block); !opened) return unexpected(opened.error());
  }
  const Solution* const start = block.newest ? &*block.newest : nullptr;
  auto solution = block.solver->solve(fresh ? ProblemUpdate{} : update, start);
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
  std::vector<double> along;
  if (is_solved(solution->status)) {
    block.newest = *solution;
    along = block.response.at(block.lifted, update, *solution);
  }
  return block.lifted.answer(*std::move(solution), std::move(along));
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
