// Threads for requests: as many as there are requests, up to a bound; beyond it a request waits.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <thread>
#include <vector>

#include "mutex.h"

namespace marble::server::http {

class TaskQueue {
 public:
  explicit TaskQueue(std::size_t most_threads) : most_threads_(most_threads) {}
  ~TaskQueue() { shutdown(); }
  TaskQueue(const TaskQueue&) = delete;
  TaskQueue& operator=(const TaskQueue&) = delete;

  /// Beyond a bound the task is dropped.
  void enqueue(std::function<void()> task) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    if (tasks_.size() >= std::max(kLeastBacklog, most_threads_)) return;
    tasks_.push_back(std::move(task));
    if (tasks_.size() > idle_ && threads_.size() < most_threads_) threads_.emplace_back([this] { work(); });
    work_.notify_one();
  }

  /// Returns when all tasks are done.
  void shutdown() ABSL_LOCKS_EXCLUDED(mutex_) {
    std::vector<std::thread> threads;
    {
      const MutexLock lock(mutex_);
      stopping_ = true;
      threads.swap(threads_);
    }
    work_.notify_all();
    for (std::thread& thread : threads) thread.join();
  }

 private:
  void work() ABSL_LOCKS_EXCLUDED(mutex_) {
    while (const std::function<void()> task = next()) task();
  }
  [[nodiscard]] std::function<void()> next() ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    ++idle_;
    while (tasks_.empty() && !stopping_) work_.wait(mutex_);
    --idle_;
    if (tasks_.empty()) return nullptr;
    std::function<void()> task = std::move(tasks_.front());
    tasks_.pop_front();
    return task;
  }

  static constexpr std::size_t kLeastBacklog = 64;

  const std::size_t most_threads_;
  Mutex mutex_;
  Condition work_;
  std::deque<std::function<void()>> tasks_ ABSL_GUARDED_BY(mutex_);
  std::vector<std::thread> threads_ ABSL_GUARDED_BY(mutex_);
  std::size_t idle_ ABSL_GUARDED_BY(mutex_) = 0;
  bool stopping_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace marble::server::http
