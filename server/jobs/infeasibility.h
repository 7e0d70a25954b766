// Why the problem of a finished job is infeasible, in bounded memory: a record outlives its solution.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "marble/report/conflict.h"
#include "marble/solution.h"

namespace marble::server {

struct Infeasibility {
  static constexpr std::size_t kMostParts = 100, kMostRows = 8;
  struct Row {
    Index row = 0;  ///< position in the certificate
    double multiplier = 0.0;
  };

  std::optional<Conflict> conflict;  ///< with its first kMostParts parts, in the order of its members
  std::int64_t more_parts = 0;
  std::vector<Row> rows;       ///< those with the largest multipliers, at most kMostRows, largest first
  std::int64_t more_rows = 0;  ///< further rows whose multiplier is not negligible
};

/// Shortens the conflict; returns the number of parts that it has lost.
[[nodiscard]] std::int64_t shorten(Conflict& conflict);

/// Returns null unless the status is infeasible. `rows`: of a certificate for the job's problem; a
/// certificate of another size is ignored. Costs one pass over the certificate.
[[nodiscard]] std::shared_ptr<const Infeasibility> infeasibility_of(const Solution& solution,
                                                                    std::size_t rows);

}  // namespace marble::server
