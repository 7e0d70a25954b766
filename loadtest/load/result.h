// Holds the results of a run.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "answer_check.h"
#include "marble/server_info.h"
#include "plan.h"
#include "tally.h"

namespace marble::load {

/// One second of a run.
struct Second {
  double at_s = 0.0;  ///< its end, from the start of the measurement; negative in the warm-up
  std::uint64_t answers = 0, errors = 0;
  double p50_s = 0.0, p99_s = 0.0,
         most_s = 0.0;              ///< latencies of measured requests whose results arrived in it
  int queued = 0, running = 0;      ///< on the server at its end
  std::int64_t resident_bytes = 0;  ///< of the server at its end
};

enum class Ending { complete, interrupted };

struct RunResult {
  Plan plan;
  double measured_s = 0.0;  ///< from the end of the warm-up to the send of the last request
  std::uint64_t sent = 0;   ///< measured requests
  Tally tally;
  double answers_per_s = 0.0;  ///< during the measurement, whenever sent
  AnswerCheck::Findings check;
  std::vector<Second> seconds;
  /// Processor seconds during the measurement: of the server, and of this process without the checks.
  double server_cpu_s = 0.0, load_cpu_s = 0.0;
  std::uint64_t answers_while_measured = 0, errors_while_measured = 0;
  ServerInfo before, after;      ///< the server's own counters
  bool lagged = false;           ///< this process sent late: it was the bottleneck, or got no processor
  bool in_flight_limit = false;  ///< sends waited for the limit on requests in progress
  std::uint64_t abandoned = 0;   ///< without a result when the run's patience, or its user's, ended
  Ending ending = Ending::complete;

  [[nodiscard]] double cpu_per_answer_s(double cpu_s) const;
  /// Returns the number of failures: errors, wrong solutions, abandoned requests.
  [[nodiscard]] std::uint64_t failures() const;
};

/// The runs of a ramp, in order of execution.
struct RampStep {
  double rate_per_s = 0.0;
  bool holds = false;
  std::string why_not;
  RunResult result;
};
struct RampResult {
  std::vector<RampStep> steps;
  double best_rate_per_s = 0.0;  ///< the highest that met the objective; 0 if none did
};

/// One run at a multiple of the capacity.
struct OverloadStep {
  double level = 0.0;           ///< of the capacity
  double capacity_per_s = 0.0;  ///< results per second
  RunResult result;

  /// Returns the results in time over those at the capacity.
  [[nodiscard]] double goodput() const { return result.answers_per_s / capacity_per_s; }
  /// Returns the part of the busy time of workers spent on results that arrived.
  [[nodiscard]] double useful() const;
};
struct OverloadResult {
  double capacity_per_s = 0.0;  ///< results of a closed loop
  std::vector<OverloadStep> steps;
};

}  // namespace marble::load
