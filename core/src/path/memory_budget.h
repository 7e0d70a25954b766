// The memory that the solvers of one coupled problem share.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <shared_mutex>

#include "marble/error.h"
#include "model/tuning.h"

namespace marble {

class MemoryBudget {
 public:
  explicit MemoryBudget(std::int64_t bytes) : left_(bytes) {}

  /// Returns the result of make(bytes), an Expected of an object with memory_bytes(), which are then taken
  /// from the budget. Threads that call it at once each get a part of the remaining memory. If the object
  /// does not fit into its part, it is made once more, exclusively, with all remaining memory.
  template <class Make>
  auto make(const Make& make) -> decltype(make(std::int64_t{})) {
    {
      const std::shared_lock lock(alone_);
      std::int64_t left = left_, part = left / tuning::coupled_parts;
      while (!left_.compare_exchange_weak(left, left - part)) part = left / tuning::coupled_parts;
      auto made = make(part);
      left_ += part;
      if (made) left_ -= made->memory_bytes();
      if (made || made.error().code != ErrorCode::resource_exhausted) return made;
    }
    const std::unique_lock lock(alone_);
    auto made = make(left_);
    if (made) left_ -= made->memory_bytes();
    return made;
  }
  void give_back(std::int64_t bytes) { left_ += bytes; }

 private:
  std::shared_mutex alone_;
  std::atomic<std::int64_t> left_;
};

}  // namespace marble
