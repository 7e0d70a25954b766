#include "environment.h"

namespace marble::testing {

constexpr std::size_t kMostFaults = 50;  // more report nothing new

void Environment::next_generation() {
  const std::scoped_lock lock(mutex_);
  ++generation_;
  changed_.notify_all();
}

int Environment::wait_for_server() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return generation_ % 2 == 0; });
  return generation_;
}

bool Environment::go_on() {
  std::unique_lock lock(mutex_);
  if (resting_) {
    ++at_rest_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !resting_; });
    --at_rest_;
  }
  return !stopped_;
}

void Environment::rest() {
  std::unique_lock lock(mutex_);
  resting_ = true;
  changed_.wait(lock, [this] { return at_rest_ == clients_; });
}

void Environment::resume() {
  const std::scoped_lock lock(mutex_);
  resting_ = false;
  changed_.notify_all();
}

void Environment::stop() { stopped_ = true; }

void Environment::fault(const std::string& text) {
  const std::scoped_lock lock(mutex_);
  if (faults_.size() < kMostFaults) faults_.push_back(text);
}

std::vector<std::string> Environment::faults() const {
  const std::scoped_lock lock(mutex_);
  return faults_;
}

}  // namespace marble::testing
