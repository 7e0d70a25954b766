// Solves the blocks of a coupled problem, each by a BlockSolver, on a TaskRunner's threads.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "marble/composite/coupled.h"
#include "marble/composite/lifted_block.h"
#include "path/memory_budget.h"

namespace marble {

class LiftedBlocks final : public BlockTicks {
 public:
  /// `view` must have passed check() and must outlive this object. Without a start, each block is first
  /// solved alone.
  LiftedBlocks(const CoupledView& view, const CoupledOptions& options, const CoupledControls& controls);

  [[nodiscard]] std::span<const std::vector<Index>> rows() const override { return rows_; }
  [[nodiscard]] std::vector<double> start(std::size_t block) const override;
  [[nodiscard]] std::string name(std::size_t block) const override;
  [[nodiscard]] Expected<std::vector<BlockAnswer>> tick(std::span<const BlockAsk> asks) override;

 private:
  struct Block {
    explicit Block(const CoupledBlock& block) : lifted(block) {}
    LiftedBlock lifted;
    std::unique_ptr<BlockSolver> solver;
    LiftedResponse response;
    std::optional<Solution> newest;  // newest solution of the current problem
    int factorizations = 0;          // not reported yet
  };
  [[nodiscard]] Expected<void> open(Block& block) const;
  void begin_alone(const std::vector<double>& coupling_multipliers);
  void each(const std::function<void(std::size_t)>& work) const;
  [[nodiscard]] Expected<BlockAnswer> solve(Block& block, const BlockAsk& ask);

  const CoupledView& view_;
  const CoupledControls& controls_;
  const Options& options_;
  MemoryBudget memory_;
  OpenBlockSolver open_;
  std::vector<std::unique_ptr<Block>> blocks_;
  std::vector<std::vector<Index>> rows_;
};

/// "block 3 (arm)".
[[nodiscard]] std::string block_name(const CoupledView& view, std::size_t block);

}  // namespace marble
