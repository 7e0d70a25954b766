// Decides what is sent when, in both loops, and knows what is under way.
#pragma once

#include <atomic>
#include <condition_variable>
#include <memory>
#include <random>
#include <stop_token>
#include <vector>

#include "lane/lanes.h"
#include "mutex.h"
#include "plan/plan.h"

namespace marble::load {

class Dispatcher {
 public:
  /// `begin` is when the warm-up begins.
  Dispatcher(const Plan& plan, const std::vector<LoadedEntry>& entries, Clock::time_point begin);

  /// Sends until the duration or the count is over, or a stop. Returns when the last request was sent.
  void run(const Lanes& lanes, const std::stop_token& stop);
  /// A request is done: in a closed loop its client sends the next one from here.
  void done(const Lanes& lanes, const Work& work);
  /// False if not everything was answered after that time, or when a stop came.
  [[nodiscard]] bool wait_for_answers(double patience_s, const std::stop_token& stop);

  [[nodiscard]] Clock::time_point measured_from() const { return measured_from_; }
  [[nodiscard]] std::uint64_t sent() const { return sent_; }  ///< measured ones
  [[nodiscard]] bool reached_limit() const { return reached_limit_; }

 private:
  void run_open(const Lanes& lanes, const std::stop_token& stop);
  void run_closed(const Lanes& lanes, const std::stop_token& stop);
  void next_of_client(const Lanes& lanes, std::size_t client);
  [[nodiscard]] Work make_work(std::mt19937_64& engine, std::size_t client, Clock::time_point intended);
  [[nodiscard]] bool over(Clock::time_point at) const;
  [[nodiscard]] bool claim(const Work& work);  // false: the count is full
  void send(const Lanes& lanes, Work& work);
  [[nodiscard]] bool sleep_until(Clock::time_point at, const std::stop_token& stop);

  const Plan& plan_;
  const std::vector<LoadedEntry>& entries_;
  const Clock::time_point begin_, measured_from_, end_;
  std::vector<double> shares_;  // of the entries, added up; the last is 1
  std::unique_ptr<std::atomic<std::size_t>[]> next_variant_;
  std::vector<std::mt19937_64> engines_;  // a client's each; each is used by one thread at a time

  std::atomic<std::uint64_t> sent_ = 0;
  std::atomic<bool> stopping_ = false, reached_limit_ = false;
  Mutex mutex_;
  std::condition_variable_any changed_;
  std::uint64_t under_way_ ABSL_GUARDED_BY(mutex_) = 0;
  int active_clients_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace marble::load
