#include "jobs/timer.h"

#include <algorithm>

namespace marble::server {

Timer::Timer() : thread_([this] { run(); }) {}

Timer::~Timer() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void Timer::add(const std::weak_ptr<TimerListener>& listener) {
  {
    const MutexLock lock(mutex_);
    listeners_.push_back(listener);
  }
  wake_.notify_all();
}

void Timer::run() {
  std::vector<std::shared_ptr<TimerListener>> alive;
  while (true) {
    {
      const MutexLock lock(mutex_);
      while (!stopping_ && listeners_.empty()) wake_.wait(mutex_);
      if (stopping_) return;
      listeners_.erase(std::remove_if(listeners_.begin(), listeners_.end(),
                                      [&](const std::weak_ptr<TimerListener>& weak) {
                                        std::shared_ptr<TimerListener> shared = weak.lock();
                                        if (shared == nullptr) return true;
                                        alive.push_back(std::move(shared));
                                        return false;
                                      }),
                       listeners_.end());
    }
    for (const auto& listener : alive) listener->on_timer(Clock::now());
    alive.clear();
    const MutexLock lock(mutex_);
    const auto next = Clock::now() + kPeriod;
    while (!stopping_ && wake_.wait_until(mutex_, next) == std::cv_status::no_timeout) {
    }
  }
}

}  // namespace marble::server
