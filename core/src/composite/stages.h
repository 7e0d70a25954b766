// Splits a base problem by stage and assembles LCQPs from the parts: that of N scenarios, and the recourse of
// one scenario for a fixed plan.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "marble/composite/scenario_samples.h"
#include "marble/composite/scenarios.h"
#include "model/interrupt.h"
#include "solver/solver_bytes.h"

namespace marble {

/// Entries of a vector, or rows of a kind, by stage, each in their original order.
struct Split {
  std::vector<Index> first, second;  ///< of the plan; of every scenario
  std::vector<Index> place;          ///< number of each entry within its stage
  std::vector<char> is_second;

  [[nodiscard]] std::size_t assembled(std::size_t scenarios) const {
    return first.size() + scenarios * second.size();
  }
};

/// Entries of a matrix by stage, in compressed columns, with their positions among the base's values.
struct Block {
  std::vector<Index> pointers, rows, positions;
};

/// Parts of a matrix: rows of the plan, and rows of a scenario by the plan's variables and by its own. For Q:
/// the upper triangles of both stages, and the block x × y between them.
struct MatrixStages {
  Block first, linking, recourse;
};

class Stages {
 public:
  /// Borrows the arrays of `problem.base`.
  [[nodiscard]] static Expected<Stages> create(const ScenarioProblem& problem);

  /// Checks that numbers fit the base and do not change the plan's own rows.
  [[nodiscard]] Expected<void> check(const ScenarioNumbers& numbers) const;

  /// Returns the index in `entries` of the first entry that no scenario may change, if there is one.
  [[nodiscard]] std::optional<std::size_t> fixed_among(const ScenarioEntries& entries) const;

  /// Assembles the LCQP of these scenarios with weights that sum to one. Fails if 32 bits cannot count its
  /// entries, and with cancelled or deadline_exceeded if interrupted.
  [[nodiscard]] Expected<OwnedProblem> assemble(std::span<const ScenarioNumbers> scenarios,
                                                std::span<const double> weights,
                                                const Interrupt& interrupt = {}) const;

  /// Returns the sizes of the LCQP of this many scenarios, before it is assembled.
  [[nodiscard]] SolverSizes assembled_sizes(double scenarios) const;
  /// Returns the bytes of that LCQP's arrays, including what the assembly needs.
  [[nodiscard]] double assembled_bytes(double scenarios) const;
  /// Returns the bytes of the vectors of its solution: z and the multipliers.
  [[nodiscard]] double answer_bytes(double scenarios) const;
  /// Returns the bytes of one scenario's part of a solution, stored as a separate Solution.
  [[nodiscard]] double part_bytes() const;

  /// Returns the LCQP in y of one scenario for a plan. All scenarios give the same pattern with other
  /// numbers.
  [[nodiscard]] OwnedProblem recourse(const ScenarioNumbers& scenario, std::span<const double> x) const;

  /// Returns the LCQP of one scenario alone, in the form of the base.
  [[nodiscard]] OwnedProblem alone(const ScenarioNumbers& scenario) const;

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
