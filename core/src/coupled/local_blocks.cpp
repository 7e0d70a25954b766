#include "coupled/local_blocks.h"

#include <cmath>
#include <utility>

#include "tuning.h"

namespace marble {

std::string block_name(const CoupledView& view, std::size_t block) {
  const std::string& name = view.blocks[block].name;
  return "block " + std::to_string(block) + (name.empty() ? "" : " (" + name + ")");
}

LocalBlocks::LocalBlocks(const CoupledView& view, const CoupledOptions& options,
                         const CoupledControls& controls)
    : view_(view), options_(options), controls_(controls) {
  for (const CoupledBlock& block : view.blocks) {
    blocks_.push_back(std::make_unique<Block>(block));
    rows_.push_back(blocks_.back()->lifted.rows());
  }
  if (controls.start == nullptr || controls.start->blocks.empty()) return;
  std::vector<double> prices = controls.start->prices;
  prices.resize(view.total.size(), 0.0);
  for (std::size_t k = 0; k < blocks_.size(); ++k)
    blocks_[k]->newest = blocks_[k]->lifted.lifted(controls.start->blocks[k], prices);
}

std::vector<double> LocalBlocks::start(std::size_t block) const {
  const Block& b = *blocks_[block];
  if (!b.newest) return {};
  return {b.newest->z.begin() + b.lifted.variables(), b.newest->z.end()};
}

std::string LocalBlocks::name(std::size_t block) const { return block_name(view_, block); }

Expected<BlockAnswer> LocalBlocks::solve(Block& block, const BlockAsk& ask) const {
  if (ask.frozen && !block.lifted.frozen()) {
    block.newest = block.lifted.freeze(*block.newest);
    block.solver.reset(), block.response.forget();
  }
  for (const Index pair : ask.flips) block.lifted.flip(pair);
  block.lifted.ask(ask);
  const ProblemUpdate update = block.lifted.update();
  if (!block.solver) {
    const auto problem = Problem::create(block.lifted.problem().view());
    if (!problem) return unexpected(problem.error());
    auto made = Solver::create(*problem, options_.options, {.stop = controls_.stop});
    if (!made) return unexpected(made.error());
    block.solver.emplace(*std::move(made));
  } else if (auto taken = block.solver->update(update); !taken) {
    return unexpected(taken.error());
  }
  SolveControls how{.stop = controls_.stop, .begun = controls_.begun};
  const bool search = ask.search && block.newest;
  if (block.newest) how.warm_start = &*block.newest;
  auto solution = block.solver->solve(how);
  if (solution && search) {
    how.warm_start = nullptr;
    auto cold = block.solver->solve(how);
    if (!cold) return unexpected(cold.error());
    const int factorizations = solution->factorizations + cold->factorizations;
    const double least = tuning::near * (1.0 + std::abs(solution->objective));
    if (is_solved(cold->status) && !(cold->objective >= solution->objective - least))
      solution = std::move(cold);
    solution->factorizations = factorizations;
  }
  if (!solution) return unexpected(solution.error());
  std::vector<double> along;
  if (is_solved(solution->status)) {
    block.newest = *solution;
    along = block.response.at(block.lifted, update, *solution);
  }
  return block.lifted.answer(*std::move(solution), std::move(along));
}

Expected<std::vector<BlockAnswer>> LocalBlocks::tick(std::span<const BlockAsk> asks) {
  std::vector<Expected<BlockAnswer>> answers(blocks_.size());
  std::vector<std::function<void()>> tasks;
  for (std::size_t k = 0; k < blocks_.size(); ++k)
    tasks.emplace_back([this, k, &asks, &answers] {
      answers[k] = or_out_of_memory([&] { return solve(*blocks_[k], asks[k]); });
    });
  if (controls_.runner != nullptr) {
    controls_.runner->run(tasks);
  } else {
    for (const auto& task : tasks) task();
  }
  std::vector<BlockAnswer> result;
  for (std::size_t k = 0; k < answers.size(); ++k) {
    if (!answers[k]) return unexpected(inside("blocks[" + std::to_string(k) + "]", answers[k].error()));
    result.push_back(*std::move(answers[k]));
  }
  return result;
}

}  // namespace marble
