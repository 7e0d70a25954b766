// An array that is being received: each element is checked and kept as it arrives, and all begin together at
// the end.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "store/job_store.h"
#include "submissions/array_setup.h"

namespace marble::server {

class Arrays;

/// An array that is not sealed leaves nothing. A client that sends an existing array again, by its request
/// id, may send all of it and then gets the existing one. Calls come one at a time.
class ArrayDraft final : public std::enable_shared_from_this<ArrayDraft> {
 public:
  /// `place` is null if an array with this request id exists.
  ArrayDraft(Arrays& arrays, const Caller& caller, std::shared_ptr<const ArraySetup> setup,
             std::shared_ptr<Scheduler::Place> place, const std::string& setup_bytes);
  ~ArrayDraft();
  ArrayDraft(const ArrayDraft&) = delete;
  ArrayDraft& operator=(const ArrayDraft&) = delete;

  /// Called before anything else.
  void open(const std::string& setup_bytes);
  /// Calls `settled`, perhaps at once, when there is capacity for more. Error fields are paths from the
  /// array's root: "elements[3].update.gradient". Errors: those of admission; resource_exhausted (too many).
  [[nodiscard]] Expected<void> add(v1::ArrayElement element, const std::function<void()>& settled)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// True if many elements are on their way to the store.
  [[nodiscard]] bool is_full() const ABSL_LOCKS_EXCLUDED(mutex_);

  /// It will not be sealed: releases its place at once.
  void drop() { place_ = nullptr; }

  using Sealed = std::function<void(const Expected<v1::SubmitArrayResponse>&)>;
  /// Ends the array with this number of elements; calls back once the array is kept. Errors:
  /// invalid_argument (none, or a different number arrived; another array has its request id), unavailable
  /// (it cannot be kept).
  void seal(std::int64_t elements, const Sealed& sealed) ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void seal_new(const Sealed& sealed) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::optional<Error> failed() const ABSL_LOCKS_EXCLUDED(mutex_);

  Arrays& arrays_;
  const Caller caller_;
  const std::shared_ptr<const ArraySetup> setup_;
  std::shared_ptr<Scheduler::Place> place_;
  const bool is_repeated_;
  const std::string id_, request_id_;
  std::string digest_;
  std::int64_t elements_ = 0;
  bool is_sealed_ = false;
  mutable Mutex mutex_;
  std::int64_t unsettled_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t unsettled_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::optional<Error> failed_ ABSL_GUARDED_BY(mutex_);  // error of writing an element
};

}  // namespace marble::server
