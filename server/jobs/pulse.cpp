#include "jobs/pulse.h"

#include <algorithm>

namespace marble::server {

Pulse::Pulse() : thread_([this] { run(); }) {}

Pulse::~Pulse() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

void Pulse::add(const std::weak_ptr<Pulsed>& pulsed) {
  {
    const MutexLock lock(mutex_);
    pulsed_.push_back(pulsed);
  }
  wake_.notify_all();
}

void Pulse::run() {
  std::vector<std::shared_ptr<Pulsed>> alive;
  while (true) {
    {
      const MutexLock lock(mutex_);
      while (!stopping_ && pulsed_.empty()) wake_.wait(mutex_);
      if (stopping_) return;
      pulsed_.erase(std::remove_if(pulsed_.begin(), pulsed_.end(),
                                   [&](const std::weak_ptr<Pulsed>& weak) {
                                     std::shared_ptr<Pulsed> shared = weak.lock();
                                     if (shared == nullptr) return true;
                                     alive.push_back(std::move(shared));
                                     return false;
                                   }),
                    pulsed_.end());
    }
    for (const auto& pulsed : alive) pulsed->pulse(Clock::now());
    alive.clear();
    const MutexLock lock(mutex_);
    const auto next = Clock::now() + kPeriod;
    while (!stopping_ && wake_.wait_until(mutex_, next) == std::cv_status::no_timeout) {
    }
  }
}

}  // namespace marble::server
