#include "jobs/result_store.h"

#include <algorithm>
#include <utility>

namespace marble::server {

constexpr std::int64_t kEntryBytes = 512;  // memory of an entry besides its result

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

std::string ResultStore::named(const std::string& client, const std::string& request_id) const {
  const MutexLock lock(mutex_);
  const auto found = ids_.find({client, request_id});
  return found == ids_.end() ? std::string() : found->second;
}

bool ResultStore::grow(const std::string& id, std::int64_t bytes) {
  std::vector<std::string> erased, without_request;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end() || found->second.result != nullptr) return false;
    if (bytes > limits_.bytes / 2 - growing_) return false;
    found->second.bytes += bytes;
    growing_ += bytes;
    bytes_ += bytes;
    without_request = make_room_for_answers();
    drop_oldest(erased);
  }
  report(request_forgotten_, without_request);
  report_all(erased);
  return true;
}

void ResultStore::release(Entry& entry) {
  if (entry.result != nullptr) return;
  growing_ -= entry.bytes;
  bytes_ -= std::exchange(entry.bytes, 0);
}

void ResultStore::stop_growing(const std::string& id) {
  const MutexLock lock(mutex_);
  if (const auto found = entries_.find(id); found != entries_.end()) release(found->second);
}

void ResultStore::drop_oldest(std::vector<std::string>& erased) {
  while (bytes_ > limits_.bytes && !ages_.empty()) {
    erased.push_back(ages_.front().id);
    erase(erased.back());
  }
}

void ResultStore::keep_request(const std::string& id, Request request) {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  if (found != entries_.end()) found->second.request = std::move(request);
}

std::optional<ResultStore::Request> ResultStore::request(const std::string& id) const {
  const MutexLock lock(mutex_);
  const auto found = entries_.find(id);
  return found == entries_.end() ? std::nullopt : found->second.request;
}

bool ResultStore::put(const std::string& id, Result result, Clock::time_point now, std::int64_t besides) {
  std::vector<std::pair<const void*, Callback>> waiters;
  std::vector<std::string> erased, without_request;
  Shared shared;
  bool kept = false;
  {
    const MutexLock lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return false;
    const bool is_first = found->second.result == nullptr;
    std::int64_t bytes =
        kEntryBytes + besides + (result.answer ? static_cast<std::int64_t>(result.answer->Length()) : 0);
    shared = std::make_shared<const Result>(std::move(result));
    waiters = std::exchange(found->second.waiters, {});  // they get it regardless of its size
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
    const std::int64_t grown = is_first ? found->second.bytes : 0;
    growing_ -= grown;
    found->second.bytes = grown + bytes;
    bytes_ += bytes;
    found->second.age = ages_.insert(ages_.end(), {id, now + limits_.keep});
    if (Entry& entry = found->second; entry.request && is_first) {
      entry.request_age = requests_.insert(requests_.end(), id);
      request_bytes_ += entry.request->bytes;
    }
    without_request = make_room_for_answers();
    drop_oldest(erased);
  }
  report(request_forgotten_, without_request);
  report_all(erased);
  for (const auto& [waiter, callback] : waiters) callback(shared);
  return kept;
}

void ResultStore::drop_request(Entry& entry) {
  request_bytes_ -= entry.request->bytes;
  requests_.erase(entry.request_age);
  entry.request.reset();
}

// Returns the ids of those whose requests were dropped.
std::vector<std::string> ResultStore::make_room_for_answers() {
  std::vector<std::string> gone;
  while (!requests_.empty() && bytes_ + request_bytes_ > limits_.bytes) {
    gone.push_back(requests_.front());
    drop_request(entries_.at(gone.back()));
  }
  return gone;
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
    release(found->second);
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
  report_all({id});
  for (const auto& [waiter, callback] : waiters) callback(nullptr);
  return true;
}

bool ResultStore::erase(const std::string& id) {
  const auto found = entries_.find(id);
  if (found == entries_.end()) return false;
  bytes_ -= found->second.bytes;
  if (found->second.result == nullptr) growing_ -= found->second.bytes;
  if (found->second.result != nullptr) {
    ages_.erase(found->second.age);
    if (found->second.request) drop_request(found->second);
  }
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
  report_all(erased);
}

void ResultStore::report_forgotten(Forgotten also) {
  const MutexLock lock(mutex_);
  also_forgotten_ = std::move(also);
}

void ResultStore::report_all(const std::vector<std::string>& forgotten) const {
  if (forgotten.empty()) return;
  Forgotten also;
  {
    const MutexLock lock(mutex_);
    also = also_forgotten_;
  }
  report(forgotten_, forgotten);
  report(also, forgotten);
}

void ResultStore::report(const Forgotten& forgotten, const std::vector<std::string>& ids) {
  if (!forgotten) return;
  for (const std::string& id : ids) forgotten(id);
}

std::int64_t ResultStore::bytes() const {
  const MutexLock lock(mutex_);
  return bytes_;
}

}  // namespace marble::server
