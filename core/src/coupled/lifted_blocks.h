// The blocks of a coupled problem by a BlockSolver each, on a TaskRunner's threads.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "marble/composite/coupled.h"
#include "marble/composite/lifted_block.h"
#include "run/memory_budget.h"

namespace marble {

class LiftedBlocks final : public BlockTicks {
 public:
  /// Of a view that check() has passed, which must outlive this. Where no start is known each
  /// block is solved by itself first.
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
    std::optional<Solution> newest;  // that was solved, of the problem in force
    int factorizations = 0;          // not told yet
  };
  [[nodiscard]] Expected<void> open(Block& block) const;
  void begin_alone(const std::vector<double>& prices);
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
