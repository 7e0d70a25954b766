// An array that is being received: each element is checked and kept as it arrives, and all begin together at
// the end.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "store/job_store.h"
#include "submissions/array_setup.h"

namespace marble::server {

/// An array that is not sealed leaves nothing. A client that sends an existing array again, by its request
/// id, may send all of it and then gets the existing one. Calls come one at a time.
class ArrayDraft : public std::enable_shared_from_this<ArrayDraft> {
 public:
  virtual ~ArrayDraft() = default;
  ArrayDraft(const ArrayDraft&) = delete;
  ArrayDraft& operator=(const ArrayDraft&) = delete;

  /// Calls `settled`, perhaps at once, when there is capacity for more. Error fields are paths from the
  /// array's root: "elements[3].update.gradient". Errors: those of admission; resource_exhausted (too many).
  [[nodiscard]] Expected<void> add(v1::ArrayElement element, const std::function<void()>& settled)
      ABSL_LOCKS_EXCLUDED(mutex_);
  /// True if many elements are on their way to the store.
  [[nodiscard]] bool is_full() const ABSL_LOCKS_EXCLUDED(mutex_);

  /// It will not be sealed: releases what it holds at once.
  virtual void drop() {}

  using Sealed = std::function<void(const Expected<v1::SubmitArrayResponse>&)>;
  /// Ends the array with this number of elements; calls back once the array is kept. Errors:
  /// invalid_argument (none, or a different number arrived; another array has its request id), unavailable
  /// (it cannot be kept).
  void seal(std::int64_t elements, const Sealed& sealed) ABSL_LOCKS_EXCLUDED(mutex_);

 protected:
  ArrayDraft(const ServiceParts& parts, const Caller& caller, std::shared_ptr<const ArraySetup> setup,
             const std::string& setup_bytes, std::int64_t most_elements);

  // Hooks of one kind of store.

  /// True if an array with this request id exists: elements are only counted.
  [[nodiscard]] virtual bool is_repeated() const = 0;
  /// Counts the bytes of one more element. Errors: resource_exhausted.
  [[nodiscard]] virtual Expected<void> add_bytes(std::int64_t bytes) = 0;
  virtual void keep(StoredElement element, CompletionCallback settled) = 0;
  /// All elements have been passed to keep().
  virtual void seal_all(const Sealed& sealed) = 0;

  /// What no longer can be sealed, and why; the first reason counts.
  void fail(const Error& why) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] std::optional<Error> failed() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Returns the array as stored.
  [[nodiscard]] StoredJob stored(const std::string& setup_bytes) const;
  [[nodiscard]] v1::SubmitArrayResponse reported(const std::string& id) const;
  [[nodiscard]] const ArraySetup& setup() const { return *setup_; }
  [[nodiscard]] std::shared_ptr<const ArraySetup> shared_setup() const { return setup_; }
  [[nodiscard]] const std::string& id() const { return id_; }
  [[nodiscard]] const std::string& request_id() const { return request_id_; }
  /// Of the set-up and the elements so far; empty if the array has no request id.
  [[nodiscard]] const std::string& digest() const { return digest_; }
  [[nodiscard]] std::int64_t elements() const { return elements_; }
  [[nodiscard]] const Caller& caller() const { return caller_; }

  const ServiceParts& parts_;

 private:
  const Caller caller_;
  const std::shared_ptr<const ArraySetup> setup_;
  const std::string id_, request_id_;
  const std::int64_t most_elements_;
  std::string digest_;
  std::int64_t elements_ = 0;
  mutable Mutex mutex_;
  std::int64_t unsettled_ ABSL_GUARDED_BY(mutex_) = 0;
  std::int64_t unsettled_bytes_ ABSL_GUARDED_BY(mutex_) = 0;
  std::optional<Error> failed_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
