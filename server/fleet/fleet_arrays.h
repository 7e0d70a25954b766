// Arrays that this server has taken from a shared store.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "fleet/fleet_store.h"
#include "service/service_parts.h"
#include "submissions/array.h"

namespace marble::server {

/// The elements of one array while this server holds it. Thread-safe.
class FleetElements final : public ElementStore {
 public:
  /// `request_bytes`: bytes of the requests without a result.
  FleetElements(FleetStore& store, std::string id, std::string token, std::int64_t request_bytes)
      : store_(store), id_(std::move(id)), token_(std::move(token)), request_bytes_(request_bytes) {}

  /// Of a claimed element, once.
  [[nodiscard]] Expected<std::string> element(const std::string& array, std::int64_t index) override
      ABSL_LOCKS_EXCLUDED(mutex_);
  void answer_element(ElementAnswer answer, CompletionCallback settled) override ABSL_LOCKS_EXCLUDED(mutex_);
  /// None: readers get them from the store, on any server.
  [[nodiscard]] Expected<std::vector<ElementAnswer>> answers_after(const std::string& /*array*/,
                                                                   std::int64_t /*after*/,
                                                                   std::int64_t /*most_bytes*/) override {
    return std::vector<ElementAnswer>();
  }
  void finish(StoredResult result, CompletionCallback settled) override {
    store_.finish(std::move(result), token_, std::move(settled));
  }
  void cancel(const std::string& /*id*/) override {}
  void began(const JobStart& /*start*/) override {}
  void ended(const std::string& /*id*/) override {}
  [[nodiscard]] bool is_durable() const override { return true; }
  [[nodiscard]] bool is_shared() const override { return true; }
  void claim(bool suspect, std::int64_t most, Claimed then) override ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] std::int64_t request_bytes() const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void claimed(const ElementClaim& claim, const Claimed& then) ABSL_LOCKS_EXCLUDED(mutex_);

  FleetStore& store_;
  const std::string id_, token_;
  mutable Mutex mutex_;
  std::int64_t claims_ ABSL_GUARDED_BY(mutex_) = 0;
  std::map<std::int64_t, std::string> requests_ ABSL_GUARDED_BY(mutex_);  // claimed, and not read yet
  std::map<std::int64_t, std::int64_t> sizes_ ABSL_GUARDED_BY(mutex_);    // claimed, and without a result
  std::int64_t request_bytes_ ABSL_GUARDED_BY(mutex_);
};

/// An array that this server works on.
struct FleetArray {
  std::shared_ptr<Array> array;
  std::shared_ptr<FleetElements> elements;
};

/// Makes the array from what the store has of it, for Array::start(). `left` is as in ArrayStart. Errors:
/// why the array ends at once; unavailable (this server drains).
[[nodiscard]] Expected<FleetArray> make_fleet_array(const ServiceParts& parts, FleetStore& store,
                                                    OneSuspect& one_suspect, const TakenJob& taken,
                                                    const std::shared_ptr<JobRecord>& record,
                                                    std::function<void()> left);

/// Limit on the elements of an array in a shared store, besides the setting array_elements: a server counts
/// them when it takes the array.
inline constexpr std::int64_t kMostFleetElements = 1'000'000;
/// PostgreSQL's limit on a value: 1 GB minus a header.
inline constexpr std::int64_t kLargestValue = 1'000'000'000;

}  // namespace marble::server
