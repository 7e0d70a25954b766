// Uses AMD of SuiteSparse (Amestoy, Davis, Duff, "Algorithm 837", 2004), which cannot be interrupted. A large
// pattern is therefore ordered on a thread of its own, and an interrupted caller does not wait for it.
#include "kkt/ordering.h"

#include <amd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <semaphore>
#include <system_error>
#include <thread>

#include "model/tuning.h"

namespace marble {
namespace {

void order_by_amd(const Pattern& pattern, std::vector<Index>& permutation) {
  const int result = amd_order(pattern.size(), pattern.pointers.data(), pattern.rows.data(),
                               permutation.data(), nullptr, nullptr);
  if (result == AMD_OUT_OF_MEMORY) throw std::bad_alloc();
}

// One ordering. The caller and the thread that computes it share ownership.
struct Work {
  explicit Work(const Pattern& asked) : pattern(asked), permutation(static_cast<std::size_t>(asked.size())) {}

  const Pattern pattern;
  std::vector<Index> permutation;
  std::mutex mutex;
  std::condition_variable ended;
  std::exception_ptr fault;
  bool has_ended = false;
};

// Abandoned orderings run to their end. The semaphore limits the number of orderings on their own threads, so
// that repeated interrupted calls do not accumulate them. Waiting for it can be interrupted.
std::counting_semaphore<>& places() {
  static std::counting_semaphore<> all(
      std::max(4, 2 * static_cast<int>(std::thread::hardware_concurrency())));
  return all;
}

void compute_apart(const std::shared_ptr<Work>& work) {
  std::exception_ptr fault;
  try {
    order_by_amd(work->pattern, work->permutation);
  } catch (...) {
    fault = std::current_exception();
  }
  places().release();
  const std::lock_guard lock(work->mutex);
  work->fault = fault;
  work->has_ended = true;
  work->ended.notify_one();
}

}  // namespace

bool order(const Pattern& pattern, const Interrupt& interrupt, std::vector<Index>& permutation) {
  if (interrupt.requested()) return false;
  if (pattern.rows.size() <= tuning::ordered_in_place) {
    permutation.resize(static_cast<std::size_t>(pattern.size()));
    order_by_amd(pattern, permutation);
    return true;
  }
  const auto work = std::make_shared<Work>(pattern);
  while (!places().try_acquire_for(std::chrono::milliseconds(tuning::ordering_looks_ms))) {
    if (interrupt.requested()) return false;
  }
  try {
    std::thread(compute_apart, work).detach();
  } catch (const std::system_error&) {  // no more threads available
    compute_apart(work);
  }
  std::unique_lock lock(work->mutex);
  while (!work->ended.wait_for(lock, std::chrono::milliseconds(tuning::ordering_looks_ms),
                               [&] { return work->has_ended; })) {
    if (interrupt.requested()) return false;
  }
  if (work->fault) std::rethrow_exception(work->fault);
  permutation = std::move(work->permutation);
  return true;
}

}  // namespace marble
