// Keeps the answer of a submitted job until its client comes for it: in memory, and on disk first where there
// is a store.
#pragma once

#include <functional>
#include <optional>
#include <utility>

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
  /// `lost`: starts of the job whose server stopped meanwhile. `then` is called after its end, without a
  /// lock.
  ResultKeeper(const ServiceParts& parts, JobStore* store, std::shared_ptr<JobRecord> record, int lost = 0,
               std::function<void()> then = {})
      : parts_(parts), store_(store), record_(std::move(record)), lost_(lost), then_(std::move(then)) {}

  /// The store was asked to add the job: its answer may follow.
  void added() ABSL_LOCKS_EXCLUDED(mutex_);
  void started(double queue_s) override;
  /// One that the server's stop has interrupted is not kept on disk: it runs when the server is back.
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
  std::optional<KeptResult> early_ ABSL_GUARDED_BY(mutex_);  // that came before
};

}  // namespace marble::server
