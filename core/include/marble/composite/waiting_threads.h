// Runs tasks that wait for others, each on its own thread.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <functional>
#include <span>
#include <system_error>
#include <thread>
#include <vector>

#include "marble/solver.h"

namespace marble {

/// Threads for tasks that wait for servers or for the owners of the blocks of a coupled solve: one per task,
/// at most 64. If no more threads can be started, the existing ones run all tasks.
class WaitingThreads final : public TaskRunner {
 public:
  void run(std::span<const std::function<void()>> tasks) override {
    constexpr std::size_t kMostThreads = 64;
    std::atomic<std::size_t> next{0};
    const auto work = [&] {
      for (std::size_t i = next++; i < tasks.size(); i = next++) tasks[i]();
    };
    std::vector<std::jthread> others;
    try {
      for (std::size_t i = 1; i < std::min(tasks.size(), kMostThreads); ++i) others.emplace_back(work);
    } catch (const std::system_error&) {  // the existing threads run all tasks
    }
    work();
  }
};

}  // namespace marble
