#include "support/allocation_guard.h"

#include <atomic>
#include <cerrno>
#include <cstddef>

namespace {

std::atomic<std::int64_t> count = 0;

void tick() { count.fetch_add(1, std::memory_order_relaxed); }

}  // namespace

namespace marble::testing {

std::int64_t allocations() { return count.load(std::memory_order_relaxed); }

}  // namespace marble::testing

// Replaces C's allocation functions, which operator new and Eigen use too, and forwards to glibc's own.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t number, std::size_t size);
void* __libc_realloc(void* old, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  tick();
  return __libc_malloc(size);
}

void* calloc(std::size_t number, std::size_t size) {
  tick();
  return __libc_calloc(number, size);
}

void* realloc(void* old, std::size_t size) {
  tick();
  return __libc_realloc(old, size);
}

void* memalign(std::size_t alignment, std::size_t size) {
  tick();
  return __libc_memalign(alignment, size);
}

void* aligned_alloc(std::size_t alignment, std::size_t size) { return memalign(alignment, size); }

int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
  *out = memalign(alignment, size);
  return *out == nullptr ? ENOMEM : 0;
}
}
