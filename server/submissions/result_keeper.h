// Keeps the answer of a submitted job until its client comes for it: in memory, and on disk first where there
// is a store.
#pragma once

#include <optional>

#include "mutex.h"
#include "queue/job.h"
#include "service/service_parts.h"

namespace marble::server {

class ResultKeeper final : public JobObserver {
 public:
  ResultKeeper(const ServiceParts& parts, std::shared_ptr<JobRecord> record)
      : parts_(parts), record_(std::move(record)) {}

  /// The store was asked to add the job: its answer may follow.
  void added() ABSL_LOCKS_EXCLUDED(mutex_);
  /// One that the server's stop has interrupted is not kept on disk: it runs when the server is back.
  void finished(Outcome outcome) override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Answer {
    StoredResult stored;
    ResultStore::Result result;
  };
  void keep(Answer answer) const;

  const ServiceParts& parts_;
  const std::shared_ptr<JobRecord> record_;
  Mutex mutex_;
  bool added_ ABSL_GUARDED_BY(mutex_) = false;
  std::optional<Answer> early_ ABSL_GUARDED_BY(mutex_);  // that came before
};

}  // namespace marble::server
