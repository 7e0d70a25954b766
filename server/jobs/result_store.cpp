#include "jobs/result_store.h"

#include <algorithm>
#include <utility>

namespace marble::server {

constexpr std::int64_t kEntryBytes = 512;  // that an entry takes besides its answer

Expected<std::string> ResultStore::expect(const std::string& id, const std::string& client,
                                          const RequestName& name) {
  const MutexLock lock(mutex_);
  if (!name.request_id.empty()) {
    const auto [named, is_new] = ids_.try_emplace({client, name.request_id}, id);
    if (!is_new) {
      if (entries_.at(named->second).name.digest == name.digest) return named->second;
      return unexpected(invalid("request_id", name.request_id,
                                "must be new: job " + named->second + " is of another request by this id"));
    }
  }
  Entry& entry = entries_[id];
  entry.client = client;
  entry.name = name;
  return id;
}

bool ResultStore::put(const std::string& id, Result result, Clock::time_point now) {
  std::vector<std::pair<const void*, Callback>> waiters;
  std::vector<std::string> erased;
  Shared shared;
  bool kept = false;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return false;
    std::int64_t bytes =
        kEntryBytes + (result.answer ? static_cast<std::int64_t>(result.answer->Length()) : 0);
    shared = std::make_shared<const Result>(std::move(result));
    waiters = std::exchange(found->second.waiters, {});  // they get it whatever its size
    if (bytes > limits_.bytes) {
      const std::string size = std::to_string(bytes);
      found->second.result = std::make_shared<const Result>(Result{
          unexpected(failure(
              ErrorCode::resource_exhausted, "result_bytes", size,
              "the answer is larger than all that is kept, " + std::to_string(limits_.bytes) + " bytes")),
          0.0});
      bytes = 0;
    } else {
      found->second.result = shared;
      kept = true;
    }
    found->second.bytes = bytes;
    bytes_ += bytes;
    found->second.age = ages_.insert(ages_.end(), {id, now + limits_.keep});
    while (bytes_ > limits_.bytes) {
      erased.push_back(ages_.front().id);
      erase(erased.back());
    }
  }
  tell(erased);
  for (const auto& [waiter, callback] : waiters) callback(shared);
  return kept;
}

std::string ResultStore::owner(const std::string& id) const {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found == entries_.end() ? std::string() : found->second.client;
}

ResultStore::Shared ResultStore::get(const std::string& id) const {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found == entries_.end() ? nullptr : found->second.result;
}

void ResultStore::wait(const std::string& id, const void* waiter, Callback callback) {
  Shared there;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found != entries_.end() && found->second.result == nullptr) {
      found->second.waiters.emplace_back(waiter, std::move(callback));
      if (!found->second.elsewhere) return;
      callback = nullptr;
    } else if (found != entries_.end()) {
      there = found->second.result;
    }
  }
  if (!callback) return fetch_(id);
  callback(there);
}

void ResultStore::kept_elsewhere(const std::string& id) {
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return;
    found->second.elsewhere = true;
    if (found->second.waiters.empty()) return;
  }
  fetch_(id);
}

void ResultStore::deliver(const std::string& id, Result result) {
  std::vector<std::pair<const void*, Callback>> waiters;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found != entries_.end()) waiters = std::exchange(found->second.waiters, {});
  }
  const auto shared = std::make_shared<const Result>(std::move(result));
  for (const auto& [waiter, callback] : waiters) callback(shared);
}

void ResultStore::stop_waiting(const std::string& id, const void* waiter) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found == entries_.end()) return;
  auto& waiters = found->second.waiters;
  waiters.erase(
      std::remove_if(waiters.begin(), waiters.end(), [waiter](const auto& w) { return w.first == waiter; }),
      waiters.end());
}

bool ResultStore::forget(const std::string& id) {
  std::vector<std::pair<const void*, Callback>> waiters;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return false;
    waiters = std::exchange(found->second.waiters, {});
    erase(id);
  }
  tell({id});
  for (const auto& [waiter, callback] : waiters) callback(nullptr);
  return true;
}

bool ResultStore::erase(const std::string& id) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return false;
  bytes_ -= found->second.bytes;
  if (found->second.result != nullptr) ages_.erase(found->second.age);
  if (!found->second.name.request_id.empty())
    ids_.erase({found->second.client, found->second.name.request_id});
  entries_.erase(found);
  return true;
}

void ResultStore::expire(Clock::time_point now) {
  std::vector<std::string> erased;
  {
    const MutexLock lock(mutex_);
    while (!ages_.empty() && ages_.front().end <= now) {
      erased.push_back(ages_.front().id);
      erase(erased.back());
    }
  }
  tell(erased);
}

void ResultStore::tell(const std::vector<std::string>& erased) const {
  if (!forgotten_) return;
  for (const std::string& id : erased) forgotten_(id);
}

std::int64_t ResultStore::bytes() const {
  const MutexLock lock(mutex_);
  return bytes_;
}

}  // namespace marble::server
