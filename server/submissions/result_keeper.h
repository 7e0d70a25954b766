// Keeps the result of a submitted job until its client fetches it: in memory, and first on disk if there is
// a store.
#pragma once

#include <functional>
#include <optional>
#include <utility>

#include "jobs/job.h"
#include "mutex.h"
#include "service/service_parts.h"
#include "store/job_store.h"

namespace marble::server {

/// How a job ended, in the form for stores and in the form for waiting clients.
struct KeptResult {
  StoredResult stored;
  ResultStore::Result result;
};
/// Makes both forms. Sets the size of the result in the record.
[[nodiscard]] KeptResult result_of(JobRecord& record, const Outcome& outcome);

class ResultKeeper final : public JobObserver {
 public:
  /// `store` may be null. `lost`: starts of the job during which the server died. `then` is called after its
  /// end, without a lock.
  ResultKeeper(const ServiceParts& parts, JobStore* store, std::shared_ptr<JobRecord> record, int lost = 0,
               std::function<void()> then = {})
      : parts_(parts), store_(store), record_(std::move(record)), lost_(lost), then_(std::move(then)) {}

  /// The store was asked to add the job: its result may follow.
  void added() ABSL_LOCKS_EXCLUDED(mutex_);
  void started(double queue_s) override;
  /// A job that the server's stop has interrupted is not kept on disk: it runs again after the restart.
  void finished(Outcome outcome) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  void keep_or_wait(Outcome outcome) ABSL_LOCKS_EXCLUDED(mutex_);
  void keep(KeptResult answer) const;

  const ServiceParts& parts_;
  JobStore* const store_;
  const std::shared_ptr<JobRecord> record_;
  const int lost_;
  const std::function<void()> then_;
  Mutex mutex_;
  bool added_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<KeptResult> early_ ABSL_GUARDED_BY(mutex_);  // a result that came before added()
};

}  // namespace marble::server
