// Decides what is sent when, in both loops, and tracks requests in progress.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <random>
#include <stop_token>
#include <vector>

#include "lanes.h"
#include "mutex.h"
#include "plan.h"

namespace marble::load {

class Dispatcher {
 public:
  /// `begin` is the start of the warm-up.
  Dispatcher(const Plan& plan, const std::vector<LoadedEntry>& entries, Clock::time_point begin);

  /// Sends until the end of the duration or the count, or a stop. Returns when the last request was sent.
  void run(const Lanes& lanes, const std::stop_token& stop);
  /// Marks a request as done: in a closed loop its client sends the next one from here.
  void done(const Lanes& lanes, const Work& work);
  /// Returns false if requests are still unanswered after that time, or on a stop.
  [[nodiscard]] bool wait_for_answers(double patience_s, const std::stop_token& stop);

  [[nodiscard]] Clock::time_point measured_from() const { return measured_from_; }
  [[nodiscard]] std::uint64_t sent() const { return sent_; }  ///< measured requests
  [[nodiscard]] bool reached_limit() const { return reached_limit_; }

 private:
  void run_open(const Lanes& lanes, const std::stop_token& stop);
  void run_closed(const Lanes& lanes, const std::stop_token& stop);
  void next_of_client(const Lanes& lanes, std::size_t client);
  [[nodiscard]] Work make_work(std::mt19937_64& engine, std::size_t client, Clock::time_point intended);
  [[nodiscard]] bool over(Clock::time_point at) const;
  [[nodiscard]] bool claim(const Work& work);  // false: the count is reached
  void send(const Lanes& lanes, Work& work);
  [[nodiscard]] bool sleep_until(Clock::time_point at, const std::stop_token& stop);

  const Plan& plan_;
  const std::vector<LoadedEntry>& entries_;
  const Clock::time_point begin_, measured_from_, end_;
  std::vector<double> shares_;  // cumulative shares of the entries; the last is 1
  std::unique_ptr<std::atomic<std::size_t>[]> next_variant_;
  std::vector<std::mt19937_64> engines_;  // one per client; each is used by one thread at a time

  std::atomic<std::uint64_t> sent_ = 0;
  std::atomic<bool> stopping_ = false, reached_limit_ = false;
  Mutex mutex_;
  std::condition_variable_any changed_;
  std::uint64_t under_way_ ABSL_GUARDED_BY(mutex_) = 0;
  int active_clients_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::load
