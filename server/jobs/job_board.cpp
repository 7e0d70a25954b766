#include "jobs/job_board.h"

#include <algorithm>

namespace marble::server {

JobBoard::Record JobBoard::make(JobDescription description, const Options& options) const {
  return std::make_shared<JobRecord>(std::move(description), options, limits_.trace_rows,
                                     limits_.trace_pairs);
}

void JobBoard::add(const Record& record) {
  const MutexLock lock(mutex_);
  if (numbers_.contains(record->id())) return;
  const std::int64_t number = next_number_++;
  records_.emplace(number, record);
  active_.emplace(number, record);
  active_list_ = nullptr;
  numbers_.emplace(record->id(), number);
}

void JobBoard::finish(const Record& record) {
  const MutexLock lock(mutex_);
  const auto number = numbers_.find(record->id());
  const bool is_known = number != numbers_.end() && records_.at(number->second) == record;
  const auto active = is_known ? active_.find(number->second)
                               : std::find_if(active_.begin(), active_.end(),
                                              [&](const auto& one) { return one.second == record; });
  if (active == active_.end()) return;
  active_.erase(active);
  active_list_ = nullptr;
  ++finished_count_;
  finished_.push_back(record);
  while (finished_.size() > static_cast<std::size_t>(limits_.history_jobs)) {
    remove(finished_.front()->id());
    finished_.pop_front();
  }
}

void JobBoard::forget(const std::string& id) {
  const MutexLock lock(mutex_);
  remove(id);
}

void JobBoard::remove(const std::string& id) {
  const auto number = numbers_.find(id);
  if (number == numbers_.end()) return;
  records_.erase(number->second);
  numbers_.erase(number);
}

JobBoard::Record JobBoard::find(const std::string& id) const {
  const MutexLock lock(mutex_);
  const auto number = numbers_.find(id);
  return number == numbers_.end() ? nullptr : records_.at(number->second);
}

Expected<JobBoard::Page> JobBoard::list(const Filter& visible, const Filter& filter, std::size_t limit,
                                        const std::string& before_id) const {
  const MutexLock lock(mutex_);
  auto end = records_.end();
  if (!before_id.empty()) {
    const auto number = numbers_.find(before_id);
    if (number == numbers_.end() || !visible(*records_.at(number->second))) {
      return unexpected(
          failure(ErrorCode::not_found, "before_job_id", before_id, "is no job that is remembered"));
    }
    end = records_.find(number->second);
  }
  Page page;
  for (auto at = end; at != records_.begin();) {
    --at;
    if (!visible(*at->second) || !filter(*at->second)) continue;
    if (page.records.size() == limit) {
      page.more = true;
      break;
    }
    page.records.push_back(at->second);
  }
  return page;
}

JobBoard::Records JobBoard::active() const {
  const MutexLock lock(mutex_);
  if (active_list_ == nullptr) {
    auto list = std::make_shared<std::vector<Record>>();
    list->reserve(active_.size());
    for (const auto& [number, record] : active_) list->push_back(record);
    active_list_ = std::move(list);
  }
  return active_list_;
}

JobBoard::Finished JobBoard::finished_since(std::int64_t& cursor) const {
  const MutexLock lock(mutex_);
  Finished result;
  const std::int64_t oldest = finished_count_ - static_cast<std::int64_t>(finished_.size());
  result.skipped = std::max<std::int64_t>(0, oldest - cursor);
  const auto first = static_cast<std::size_t>(std::max(cursor, oldest) - oldest);
  for (std::size_t at = first; at < finished_.size(); ++at) result.records.push_back(finished_[at]);
  cursor = finished_count_;
  return result;
}

std::int64_t JobBoard::finished() const {
  const MutexLock lock(mutex_);
  return finished_count_;
}

}  // namespace marble::server
