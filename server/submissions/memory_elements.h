// Elements of arrays and their results in memory, for a server without a store.
#pragma once

#include <map>
#include <unordered_map>

#include "store/job_store.h"

namespace marble::server {

/// Every change is done at once. Thread-safe.
class MemoryElements final : public ArrayStore {
 public:
  void open_array(StoredJob array, CompletionCallback settled) override ABSL_LOCKS_EXCLUDED(mutex_);
  void add_element(StoredElement element, CompletionCallback settled) override ABSL_LOCKS_EXCLUDED(mutex_);
  void seal_array(const std::string& /*id*/, std::int64_t /*elements*/, const std::string& /*digest*/,
                  CompletionCallback settled) override {
    settled({});
  }
  [[nodiscard]] Expected<std::string> element(const std::string& array, std::int64_t index) override
      ABSL_LOCKS_EXCLUDED(mutex_);
  void answer_element(ElementAnswer answer, CompletionCallback settled) override ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<std::vector<ElementAnswer>> answers_after(const std::string& array,
                                                                   std::int64_t after,
                                                                   std::int64_t most_bytes) override
      ABSL_LOCKS_EXCLUDED(mutex_);
  void finish(StoredResult result, CompletionCallback settled) override ABSL_LOCKS_EXCLUDED(mutex_);
  void cancel(const std::string& /*id*/) override {}
  void forget(const std::string& id) override ABSL_LOCKS_EXCLUDED(mutex_);
  void began(const JobStart& /*start*/) override {}
  void ended(const std::string& /*id*/) override {}
  [[nodiscard]] bool is_durable() const override { return false; }
  void when_settled(CompletionCallback settled) override { settled({}); }

 private:
  struct Kept {
    std::unordered_map<std::int64_t, std::string> requests;
    std::vector<ElementAnswer> answers;  // in order
  };
  Mutex mutex_;
  std::map<std::string, Kept> arrays_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
