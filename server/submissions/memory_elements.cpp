#include "submissions/memory_elements.h"

#include <utility>

namespace marble::server {

void MemoryElements::open_array(StoredJob array, CompletionCallback settled) {
  {
    const MutexLock lock(mutex_);
    arrays_.try_emplace(array.id);
  }
  settled({});
}

void MemoryElements::add_element(StoredElement element, CompletionCallback settled) {
  {
    const MutexLock lock(mutex_);
    if (const auto found = arrays_.find(element.array); found != arrays_.end())
      found->second.requests.emplace(element.index, std::move(element.request));
  }
  settled({});
}

Expected<std::string> MemoryElements::element(const std::string& array, std::int64_t index) {
  const MutexLock lock(mutex_);
  if (const auto found = arrays_.find(array); found != arrays_.end()) {
    const auto request = found->second.requests.find(index);
    if (request != found->second.requests.end()) return request->second;
  }
  return unexpected(failure(ErrorCode::not_found, "element", std::to_string(index), "is not kept any more"));
}

// Nothing is kept for an array that was dropped meanwhile.
void MemoryElements::answer_element(ElementAnswer answer, CompletionCallback settled) {
  {
    const MutexLock lock(mutex_);
    if (const auto found = arrays_.find(answer.array); found != arrays_.end()) {
      Kept& kept = found->second;
      kept.requests.erase(answer.index);
      answer.sequence = static_cast<std::int64_t>(kept.answers.size()) + 1;
      kept.answers.push_back(std::move(answer));
    }
  }
  settled({});
}

Expected<std::vector<ElementAnswer>> MemoryElements::answers_after(const std::string& array,
                                                                   std::int64_t after,
                                                                   std::int64_t most_bytes) {
  const MutexLock lock(mutex_);
  std::vector<ElementAnswer> answers;
  const auto found = arrays_.find(array);
  if (found == arrays_.end()) return answers;
  const std::vector<ElementAnswer>& all = found->second.answers;
  std::int64_t bytes = 0;
  for (auto at = static_cast<std::size_t>(after); at < all.size() && (answers.empty() || bytes < most_bytes);
       ++at) {
    bytes += static_cast<std::int64_t>(all[at].message.size()) + 1;
    answers.push_back(all[at]);
  }
  return answers;
}

// Requests of elements that were not solved are not needed any more.
void MemoryElements::finish(StoredResult result, CompletionCallback settled) {
  {
    const MutexLock lock(mutex_);
    if (const auto found = arrays_.find(result.id); found != arrays_.end()) found->second.requests.clear();
  }
  settled({});
}

void MemoryElements::forget(const std::string& id) {
  const MutexLock lock(mutex_);
  arrays_.erase(id);
}

}  // namespace marble::server
