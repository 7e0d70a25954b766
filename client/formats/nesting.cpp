#include "nesting.h"

#include <pthread.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace marble::formats {
namespace {

constexpr std::size_t kDeepest = 10'000;
constexpr std::size_t kBytesOfLevel = 1024;        // measured: 960 at most, in readers and library
constexpr std::size_t kBytesOfOthers = 96 * 1024;  // for callers and callees of these functions

// Returns the bytes of this thread's stack that are free below this function.
std::size_t free_stack() {
  pthread_attr_t attributes;
  if (pthread_getattr_np(pthread_self(), &attributes) != 0) return 0;
  void* lowest = nullptr;
  std::size_t size = 0;
  pthread_attr_getstack(&attributes, &lowest, &size);
  pthread_attr_destroy(&attributes);
  const auto here = reinterpret_cast<std::uintptr_t>(&attributes),
             end = reinterpret_cast<std::uintptr_t>(lowest);
  return here > end ? here - end : 0;
}

}  // namespace

int deepest_nesting() {
  const std::size_t free = free_stack();
  const std::size_t fitting = free > kBytesOfOthers ? (free - kBytesOfOthers) / kBytesOfLevel : 0;
  return static_cast<int>(std::min(fitting, kDeepest));
}

}  // namespace marble::formats
