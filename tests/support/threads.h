// Provides a TaskRunner with a given number of threads.
#pragma once

#include <atomic>
#include <thread>
#include <vector>

#include "marble/solver.h"

namespace marble::testing {

class Threads final : public TaskRunner {
 public:
  /// Includes the calling thread.
  explicit Threads(int count) : count_(count) {}

  void run(std::span<const std::function<void()>> tasks) override {
    std::atomic<std::size_t> next{0};
    const auto work = [&] {
      for (std::size_t i = next++; i < tasks.size(); i = next++) tasks[i]();
    };
    std::vector<std::jthread> others;
    for (int i = 1; i < count_; ++i) others.emplace_back(work);
    work();
  }

 private:
  int count_;
};

}  // namespace marble::testing
