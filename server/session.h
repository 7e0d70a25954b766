// What a session keeps between its solves: the solver with all that was analysed, and the last solution.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "marble/solver.h"
#include "marble/v1/session.pb.h"

namespace marble::server {

/// `newer` takes along what `older` would have changed and it does not change itself.
void take_along(v1::SessionUpdate older, v1::SessionUpdate& newer);

/// Moves the entries of each block, one block after the other.
void shift(const google::protobuf::RepeatedPtrField<v1::ShiftBlock>& blocks, std::vector<double>& values);

/// check() may be called at any time, everything else by one thread at a time.
class Session {
 public:
  Session(const Problem& problem, const Options& options);

  /// Makes the solver. The problem's arrays are not needed any more afterwards. Errors: resource_exhausted.
  [[nodiscard]] Expected<void> set_up(const Problem& problem, std::span<const double> initial_z,
                                      std::int64_t most_bytes);

  /// Whether solve() can take it, but for its options. Error fields are paths from the update's root.
  [[nodiscard]] Expected<void> check(const v1::SessionUpdate& update) const;

  /// Takes the new numbers, and solves from the last solution with these options.
  [[nodiscard]] Expected<Solution> solve(const v1::SessionUpdate& update, const Options& options,
                                         const SolveControls& given);

  [[nodiscard]] std::int64_t memory_bytes() const;
  [[nodiscard]] double setup_s() const { return setup_s_; }

 private:
  void prepare_start(const v1::SessionUpdate& update);

  const PartSizes sizes_;
  const int scaling_passes_;
  std::unique_ptr<Solver> solver_;
  double setup_s_ = 0.0;
  std::optional<Solution> last_;   // the newest one that was solved, to start from
  std::vector<double> initial_z_;  // where a cold start begins
};

}  // namespace marble::server
