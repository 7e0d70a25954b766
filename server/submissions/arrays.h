// All arrays of this server: those that are being received, run, or have results that are kept.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "submissions/array.h"
#include "submissions/local_array_draft.h"

namespace marble::server {

/// Thread-safe.
class Arrays final : public std::enable_shared_from_this<Arrays> {
 public:
  /// In memory if there is no store. From now on it is notified of the results that are dropped.
  [[nodiscard]] static std::shared_ptr<Arrays> make(const ServiceParts& parts, JobStore* store);

  /// Begins to receive an array. Error fields are paths from the set-up's root. Errors: those of admission;
  /// unavailable (draining, or the store cannot write).
  [[nodiscard]] Expected<std::shared_ptr<ArrayDraft>> begin(const Caller& caller, v1::ArraySetup setup);

  /// Null if there is none by this id, or not any more.
  [[nodiscard]] std::shared_ptr<Array> find(const std::string& id) const ABSL_LOCKS_EXCLUDED(mutex_);
  /// A job of any kind was dropped.
  void forgotten(const std::string& id) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Recovers an array that the store had at the start: its id is expected among the results already.
  /// Errors: unavailable (the store cannot be read).
  [[nodiscard]] Expected<void> take_up(const StoredJob& stored) ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<void> take_up_answered(const StoredResult& stored,
                                                const std::shared_ptr<JobRecord>& record)
      ABSL_LOCKS_EXCLUDED(mutex_);

  [[nodiscard]] OneSuspect& one_suspect() { return one_suspect_; }

 private:
  friend class LocalArrayDraft;
  Arrays(const ServiceParts& parts, JobStore* store);
  void run(ArrayStart start) ABSL_LOCKS_EXCLUDED(mutex_);
  /// False if most of them are missing, or have numbers that were never assigned.
  [[nodiscard]] Expected<bool> read_elements(const std::string& id, std::int64_t elements, ArrayStart& start);
  void take_up_broken(const StoredJob& stored, const Error& error);

  const ServiceParts& parts_;
  JobStore* const on_disk_;
  const std::unique_ptr<ArrayStore> in_memory_;
  ArrayStore& elements_;
  OneSuspect one_suspect_;
  mutable Mutex mutex_;
  std::map<std::string, std::shared_ptr<Array>> arrays_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
