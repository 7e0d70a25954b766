// Keeps the model in step with the server, on its own threads, and reconnects after a loss.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "marble/client.h"
#include "mutex.h"
#include "watch/model.h"

namespace marble::cli {

/// Returns seconds of a steady clock: the clock of the model's times.
[[nodiscard]] double steady_now_s();

/// The model, behind a lock. `change` and `look` must be fast.
class SharedModel {
 public:
  explicit SharedModel(std::string address) { model_.address = std::move(address); }

  template <class Change>
  void change(Change&& change) {
    const MutexLock lock(mutex_);
    change(model_);
    ++version_;
  }
  template <class Look>
  [[nodiscard]] auto look(Look&& look) const {
    const MutexLock lock(mutex_);
    return look(std::as_const(model_));
  }
  /// Returns a number that changes with every change of the model.
  [[nodiscard]] std::int64_t version() const {
    const MutexLock lock(mutex_);
    return version_;
  }

 private:
  mutable Mutex mutex_;
  Model model_ ABSL_GUARDED_BY(mutex_);
  std::int64_t version_ ABSL_GUARDED_BY(mutex_) = 0;
};

class Feed {
 public:
  /// Both must outlive it.
  Feed(const Client& client, SharedModel& model);
  /// Cancels its requests and streams; a requested cancellation of a job is still sent.
  ~Feed();
  Feed(const Feed&) = delete;
  Feed& operator=(const Feed&) = delete;

  /// Follows one job with every row, instead of the previous one.
  void open(const std::string& job_id);
  void close();
  /// Requests the server to cancel a job; the result becomes the model's notice.
  void cancel(std::string job_id);
  /// Returns an error that no retry can fix: the server rejects this caller. The feed has stopped then.
  [[nodiscard]] std::optional<Error> refusal() const;

 private:
  void follow_jobs(const std::stop_token& stop);
  void follow_server(const std::stop_token& stop);
  void follow_one(const std::string& job_id, const std::stop_token& stop);
  void make_requests(const std::stop_token& stop);
  /// Waits for the next one; nothing after a stop once none is left.
  [[nodiscard]] std::optional<std::string> next_to_cancel(const std::stop_token& stop);
  [[nodiscard]] bool gave_up(const Error& error);
  void pause(const std::stop_token& stop, double seconds);

  const Client& client_;
  SharedModel& model_;
  mutable Mutex mutex_;
  std::condition_variable_any woken_;
  std::deque<std::string> to_cancel_ ABSL_GUARDED_BY(mutex_);
  std::optional<Error> refusal_ ABSL_GUARDED_BY(mutex_);
  // Declared last, so that all other members outlive them.
  std::jthread jobs_, server_, requests_, one_;
};

}  // namespace marble::cli
