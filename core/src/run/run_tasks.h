#pragma once

#include <functional>
#include <span>

#include "marble/solver.h"

namespace marble {

/// All of them, on the runner; one after the other where there is none.
inline void run_tasks(TaskRunner* runner, std::span<const std::function<void()>> tasks) {
  if (runner != nullptr) return runner->run(tasks);
  for (const auto& task : tasks) task();
}

}  // namespace marble
