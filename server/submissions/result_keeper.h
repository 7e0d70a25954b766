// Keeps the answer of a submitted job until its client comes for it: in memory, and on disk first where there
// is a store.
#pragma once

#include <optional>

#include "mutex.h"
#include "queue/job.h"
#include "service/service_parts.h"
#include "store/job_store.h"

namespace marble::server {

/// How a job ended, as stores have it and as those who wait have it.
struct KeptResult {
  StoredResult stored;
  ResultStore::Result result;
};
/// Its record has the size of the answer from then on.
[[nodiscard]] KeptResult result_of(JobRecord& record, const Outcome& outcome);

class ResultKeeper final : public JobObserver {
 public:
  /// `store` may be null.
  ResultKeeper(const ServiceParts& parts, JobStore* store, std::shared_ptr<JobRecord> record)
      : parts_(parts), store_(store), record_(std::move(record)) {}

  /// The store was asked to add the job: its answer may follow.
  void added() ABSL_LOCKS_EXCLUDED(mutex_);
  /// One that the server's stop has interrupted is not kept on disk: it runs when the server is back.
  void finished(Outcome outcome) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void keep(KeptResult answer) const;

  const ServiceParts& parts_;
  JobStore* const store_;
  const std::shared_ptr<JobRecord> record_;
  Mutex mutex_;
  bool added_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<KeptResult> early_ ABSL_GUARDED_BY(mutex_);  // that came before
};

}  // namespace marble::server
