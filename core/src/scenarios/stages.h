// A base problem's parts by stage, and what is put together of them: the LCQP of N worlds, and the recourse
// of one at a fixed plan.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "data/interrupt.h"
#include "marble/composite/scenarios.h"
#include "marble/composite/worlds.h"
#include "solver_bytes.h"

namespace marble {

/// Entries of a vector or rows of a kind by stage, each in their order.
struct Split {
  std::vector<Index> first, second;  ///< of the plan; of every world
  std::vector<Index> place;          ///< of each entry: its number within its stage
  std::vector<char> is_second;

  [[nodiscard]] std::size_t assembled(std::size_t worlds) const {
    return first.size() + worlds * second.size();
  }
};

/// Entries of a matrix by stage, in compressed columns: where each is among the base's values.
struct Block {
  std::vector<Index> pointers, rows, positions;
};

/// Of a matrix: rows of the plan, and rows of a world by the plan's variables and by its own. Of Q: the upper
/// triangles of both, and between them x × y.
struct MatrixStages {
  Block first, linking, recourse;
};

class Stages {
 public:
  /// Borrows the arrays of `problem.base`.
  [[nodiscard]] static Expected<Stages> create(const ScenarioProblem& problem);

  /// Whether numbers fit the base and leave the plan's own rows alone.
  [[nodiscard]] Expected<void> check(const ScenarioNumbers& numbers) const;

  /// Of entries of a part, the first that no world may change: its number among them.
  [[nodiscard]] std::optional<std::size_t> fixed_among(const ScenarioEntries& entries) const;

  /// The LCQP of these worlds with weights that sum to one. Fails where 32 bits do not count its entries, and
  /// with cancelled or deadline_exceeded where it is interrupted.
  [[nodiscard]] Expected<OwnedProblem> assemble(std::span<const ScenarioNumbers> worlds,
                                                std::span<const double> weights,
                                                const Interrupt& interrupt = {}) const;

  /// Of the LCQP of so many scenarios, before it is there.
  [[nodiscard]] SolverSizes assembled_sizes(double scenarios) const;
  /// Bytes of that LCQP's arrays, with what assembling it takes besides.
  [[nodiscard]] double assembled_bytes(double scenarios) const;
  /// Bytes of an answer's vectors to it: z and the multipliers.
  [[nodiscard]] double answer_bytes(double scenarios) const;
  /// Bytes of one scenario's part of an answer, as it is kept: a Solution of its own.
  [[nodiscard]] double part_bytes() const;

  /// The LCQP in y of one world for a plan; that of others has the same pattern and other numbers.
  [[nodiscard]] OwnedProblem recourse(const ScenarioNumbers& world, std::span<const double> x) const;

  /// The LCQP of one world by itself, as the base has it.
  [[nodiscard]] OwnedProblem alone(const ScenarioNumbers& world) const;

  [[nodiscard]] const Problem& base() const { return base_; }

  Split variables, equalities, inequalities, pairs;

 private:
  explicit Stages(const Problem& base) : base_(base) {}

  Problem base_;
  MatrixStages Q_, A_, C_, L_, R_;

  struct Part;
  template <class Visit>
  void each_part(const Visit& visit) const;
};

}  // namespace marble
