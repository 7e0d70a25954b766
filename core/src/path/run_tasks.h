#pragma once

#include <functional>
#include <span>

#include "marble/solver.h"

namespace marble {

/// Runs all tasks on the runner, or one after the other if there is none.
inline void run_tasks(TaskRunner* runner, std::span<const std::function<void()>> tasks) {
  if (runner != nullptr) return runner->run(tasks);
  for (const auto& task : tasks) task();
}

}  // namespace marble
