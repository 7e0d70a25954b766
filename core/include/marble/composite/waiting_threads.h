// Tasks that wait for others, each on a thread of its own.
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

/// Threads that wait, for servers or for whoever has the blocks of a coupled solve: one a task, at most 64.
/// Where no more threads are to be had those that there are do it.
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
    } catch (const std::system_error&) {  // those that there are do it
    }
    work();
  }
};

}  // namespace marble
