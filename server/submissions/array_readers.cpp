// Array: its results as its readers get them.
#include <algorithm>

#include "submissions/array.h"

namespace marble::server {

Expected<Array::News> Array::news_after(std::int64_t sequence, std::int64_t most_bytes) {
  News news;
  {
    const MutexLock lock(mutex_);
    if (is_gone_) return unexpected(array_deleted(description().id));
    news.is_over = stage_ == Stage::over && sequence >= last_sequence_;
    if (news.is_over) news.end = end_;
    if (sequence >= last_sequence_) return news;
    if (!newest_.empty() && newest_.front().sequence <= sequence + 1) {
      const auto first = newest_.begin() + (sequence + 1 - newest_.front().sequence);
      news.answers.assign(first, newest_.end());
      return news;
    }
  }
  MARBLE_ASSIGN_OR_RETURN(news.answers, store_.answers_after(description().id, sequence, most_bytes));
  if (news.answers.empty())
    return unexpected(failure(ErrorCode::internal, "an answer of the array cannot be read any more"));
  return news;
}

std::int64_t Array::elements() const {
  const MutexLock lock(mutex_);
  return counts_.elements;
}

std::int64_t Array::answer_bytes() const {
  const MutexLock lock(mutex_);
  return answer_bytes_;
}

void Array::listen(const std::weak_ptr<ArrayListener>& listener) {
  const MutexLock lock(mutex_);
  std::erase_if(listeners_, [](const auto& one) { return one.expired(); });
  listeners_.push_back(listener);
}

void Array::report() {
  std::vector<std::shared_ptr<ArrayListener>> all;
  {
    const MutexLock lock(mutex_);
    for (const auto& weak : listeners_) {
      if (auto listener = weak.lock()) all.push_back(std::move(listener));
    }
  }
  for (const auto& listener : all) listener->news();
}

}  // namespace marble::server
