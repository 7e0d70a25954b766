#include "connection/patience.h"

#include <algorithm>
#include <condition_variable>
#include <random>

#include "mutex.h"

namespace marble::client {
namespace {

using Seconds = Patience::Seconds;

constexpr Seconds kFirstPause(0.1), kLongestPause(1.0);
constexpr Seconds kWait(10.0), kWaitForUnauthenticated(0.7);
constexpr double kShortest = 0.8;  // of a pause

}  // namespace

double random_factor(double low, double high) {
  thread_local std::minstd_rand random{std::random_device{}()};
  return std::uniform_real_distribution(low, high)(random);
}

void Patience::reached() {
  reached_ = true;
  since_.reset();
}

std::optional<Seconds> Patience::pause() {
  const auto now = std::chrono::steady_clock::now();
  if (!since_) {
    since_ = now;
    next_ = kFirstPause;
  }
  const Seconds left = wait_.value_or(reached_ ? kWait : kWaitForUnauthenticated) - (now - *since_);
  if (!(left > Seconds(0.0))) return std::nullopt;
  const Seconds pause = std::min(next_ * random_factor(kShortest, 1.0), left);
  next_ = std::min(2.0 * next_, kLongestPause);
  return pause;
}

bool is_stopped_within(Seconds pause, const std::stop_token& stop) {
  Mutex mutex;
  std::condition_variable_any ended;
  const MutexLock lock(mutex);
  return ended.wait_for(mutex, stop, pause, [] { return false; }) || stop.stop_requested();
}

}  // namespace marble::client
