#include "remote/batch_queue.h"

#include <algorithm>

namespace marble::client {

bool BatchQueue::put(std::int64_t tag, v1::SolveBatchRequest request) {
  const MutexLock lock(mutex_);
  const std::int64_t number = numbers_++;
  request.set_tag(number);
  open_.emplace(number, Open{tag, std::make_shared<const v1::SolveBatchRequest>(std::move(request))});
  due_.push_back(number);
  changed_.notify_all();
  while (!closed_ && sent_ <= number) changed_.wait(mutex_);
  return !closed_;
}

void BatchQueue::refuse(std::int64_t tag, Error error) {
  const MutexLock lock(mutex_);
  refused_.emplace_back(tag, std::move(error));
}

void BatchQueue::exhaust() {
  const MutexLock lock(mutex_);
  exhausted_ = true;
  changed_.notify_all();
}

int BatchQueue::begin_stream() {
  const MutexLock lock(mutex_);
  due_.clear();
  later_.clear();
  for (const auto& [number, one] : open_) due_.push_back(number);
  is_open_ = true;
  changed_.notify_all();
  return ++stream_;
}

void BatchQueue::end_stream() {
  const MutexLock lock(mutex_);
  is_open_ = false;
  changed_.notify_all();
}

BatchQueue::Request BatchQueue::next(int stream) {
  const MutexLock lock(mutex_);
  while (!closed_ && is_open_ && stream == stream_ && !(exhausted_ && open_.empty())) {
    for (const auto now = Clock::now(); !later_.empty() && later_.begin()->first <= now;) {
      due_.push_back(later_.begin()->second);
      later_.erase(later_.begin());
    }
    while (!due_.empty()) {
      const std::int64_t number = due_.front();
      due_.pop_front();
      const auto found = open_.find(number);
      if (found == open_.end()) continue;
      sent_ = std::max(sent_, number + 1);
      changed_.notify_all();
      return found->second.request;
    }
    if (later_.empty()) {
      changed_.wait(mutex_);
    } else {
      const Clock::time_point end = later_.begin()->first;  // the entry may be gone by then
      changed_.wait_until(mutex_, end);
    }
  }
  return nullptr;
}

void BatchQueue::close() {
  const MutexLock lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

bool BatchQueue::is_closed() {
  const MutexLock lock(mutex_);
  return closed_;
}

std::optional<std::int64_t> BatchQueue::answered(std::int64_t number) {
  const MutexLock lock(mutex_);
  const auto found = open_.find(number);
  if (found == open_.end()) return std::nullopt;
  const std::int64_t tag = found->second.tag;
  open_.erase(found);
  changed_.notify_all();
  return tag;
}

void BatchQueue::send_again(std::int64_t number, Clock::time_point when) {
  const MutexLock lock(mutex_);
  if (open_.find(number) == open_.end()) return;
  later_.emplace(when, number);
  changed_.notify_all();
}

bool BatchQueue::done() {
  const MutexLock lock(mutex_);
  return exhausted_ && open_.empty();
}

std::vector<std::pair<std::int64_t, Error>> BatchQueue::refused() {
  const MutexLock lock(mutex_);
  return std::exchange(refused_, {});
}

std::vector<std::int64_t> BatchQueue::unanswered() {
  const MutexLock lock(mutex_);
  std::vector<std::int64_t> tags;
  for (const auto& [number, one] : open_) tags.push_back(one.tag);
  return tags;
}

}  // namespace marble::client
