// What a run found.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "marble/server_info.h"
#include "measure/answer_check.h"
#include "measure/tally.h"
#include "plan/plan.h"

namespace marble::load {

/// One second of a run.
struct Second {
  double at_s = 0.0;  ///< its end, since the measurement began; negative in the warm-up
  std::uint64_t answers = 0, errors = 0;
  double p50_s = 0.0, p99_s = 0.0,
         most_s = 0.0;              ///< latencies of answers to measured requests that came in it
  int queued = 0, running = 0;      ///< on the server at its end
  std::int64_t resident_bytes = 0;  ///< of the server at its end
};

enum class Ending { complete, interrupted };

struct RunResult {
  Plan plan;
  double measured_s = 0.0;  ///< from the end of the warm-up to the last request's sending
  std::uint64_t sent = 0;   ///< measured requests
  Tally tally;
  double answers_per_s = 0.0;  ///< while it was measured, whenever sent
  AnswerCheck::Findings check;
  std::vector<Second> seconds;
  /// Processor time in seconds while it was measured: of the server, and of this process without the checks.
  double server_cpu_s = 0.0, load_cpu_s = 0.0;
  std::uint64_t answers_while_measured = 0, errors_while_measured = 0;
  ServerInfo before, after;  ///< the server's own counters
  bool lagged = false;       ///< this process sent late: it was the bottleneck, or had none of the processors
  bool in_flight_limit = false;  ///< sending waited, because as many requests as allowed were under way
  std::uint64_t abandoned = 0;   ///< not answered when the run's patience, or its user's, ended
  Ending ending = Ending::complete;

  [[nodiscard]] double cpu_per_answer_s(double cpu_s) const;
  /// All that went wrong: errors, wrong answers, abandoned ones.
  [[nodiscard]] std::uint64_t failures() const;
};

/// The runs of a ramp, in the order they were made.
struct RampStep {
  double rate_per_s = 0.0;
  bool holds = false;
  std::string why_not;
  RunResult result;
};
struct RampResult {
  std::vector<RampStep> steps;
  double best_rate_per_s = 0.0;  ///< the highest that held; 0 if none did
};

/// One run at a multiple of the capacity.
struct OverloadStep {
  double level = 0.0;           ///< of the capacity
  double capacity_per_s = 0.0;  ///< answers
  RunResult result;

  /// Answers in time, of those that the capacity would have given.
  [[nodiscard]] double goodput() const { return result.answers_per_s / capacity_per_s; }
  /// Of the time that workers were busy, the part that was spent on answers that came.
  [[nodiscard]] double useful() const;
};
struct OverloadResult {
  double capacity_per_s = 0.0;  ///< answers of a closed loop
  std::vector<OverloadStep> steps;
};

}  // namespace marble::load
