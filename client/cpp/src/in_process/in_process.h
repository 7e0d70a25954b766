// Implements the calls of a client without a server: core's solver in the callers' own threads.
#pragma once

#include <chrono>
#include <optional>

#include "marble/batch.h"
#include "marble/call_controls.h"
#include "marble/solver.h"

namespace marble::client {

inline constexpr const char* kInProcess = "in process";

/// Returns the error of calls that need a server.
[[nodiscard]] inline Error no_server() {
  return failure(ErrorCode::unavailable, "address",
                 "there is no server: this client solves in process (local)");
}

/// Returns the error of a solve that the caller's stop token ended.
[[nodiscard]] inline Error given_up() { return failure(ErrorCode::cancelled, "given up by the caller"); }

[[nodiscard]] Expected<RemoteSolution> solve_locally(const ProblemView& problem, const Options& options,
                                                     const SolveControls& controls, const CallControls& call);

[[nodiscard]] Expected<void> solve_batch_locally(const BatchSource& source, const BatchSink& sink,
                                                 const BatchControls& controls);

/// A deadline as a limit of one solve in process: a solve that exceeds it has no solution.
class DeadlineLimit {
 public:
  explicit DeadlineLimit(std::optional<std::chrono::duration<double>> from_now);
  /// Returns `options` with the time left until the deadline.
  [[nodiscard]] Options limit(Options options) const;
  /// Returns the solution, or the error deadline_exceeded, or cancelled if it was stopped, as a client of a
  /// server gets them.
  [[nodiscard]] Expected<RemoteSolution> answer(Expected<Solution> solution) const;
  /// The same for an update, whose solution has its best point if the time was up.
  [[nodiscard]] Expected<RemoteSolution> answer_of_session(Expected<Solution> solution) const;

 private:
  [[nodiscard]] double left_s() const;
  std::chrono::steady_clock::time_point begin_;
  double seconds_;
};

/// Thins progress out as a server does.
class ThinnedProgress final : public ProgressSink {
 public:
  ThinnedProgress(ProgressSink* sink, double interval_s, std::int32_t iterate_every)
      : sink_(sink), interval_s_(interval_s), iterate_every_(iterate_every) {}
  void report(const Progress& progress) override;
  /// Null if no one receives progress.
  [[nodiscard]] ProgressSink* sink() { return sink_ == nullptr ? nullptr : this; }

 private:
  ProgressSink* sink_;
  double interval_s_;
  std::int32_t iterate_every_;
  double last_s_ = -1.0;
};

}  // namespace marble::client
