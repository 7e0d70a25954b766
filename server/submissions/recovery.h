// Recovers the contents of the store at a start of the server: results are kept, and jobs without one wait
// again.
#pragma once

#include <deque>
#include <memory>

#include "mutex.h"
#include "service/service_parts.h"
#include "store/job_store.h"
#include "submissions/arrays.h"

namespace marble::server {

/// Jobs enter the queue in the order in which they were accepted, as it has capacity: after limits were
/// lowered, some wait here. So do suspects: jobs that ran when a server was killed. One suspect runs at a
/// time, so that the next kill is the fault of at most one of them.
class Recovery final : public RoomWaiter, public std::enable_shared_from_this<Recovery> {
 public:
  /// Called before any other method. Errors: unavailable (the store cannot be read).
  [[nodiscard]] static Expected<std::shared_ptr<Recovery>> begin(const ServiceParts& parts, Arrays& arrays,
                                                                 JobStore& store);

  void room() override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  Recovery(const ServiceParts& parts, Arrays& arrays, JobStore& store)
      : parts_(parts), arrays_(arrays), store_(store) {}
  void expect(const std::string& id, const std::string& client, const ResultStore::RequestName& name) const;
  [[nodiscard]] Expected<void> take_up_answers();
  [[nodiscard]] Expected<void> take_up_jobs() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<void> take_up_array(const StoredJob& stored);
  void give_up(const std::shared_ptr<Job>& job) ABSL_LOCKS_EXCLUDED(mutex_);
  void admit_suspect() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  [[nodiscard]] Expected<std::shared_ptr<Job>> remade(const StoredJob& stored);
  [[nodiscard]] Expected<std::shared_ptr<Job>> checked(const StoredJob& stored);
  void end(const StoredJob& stored, const Error& error) const;
  void end(const std::shared_ptr<JobRecord>& record, const Error& error) const;

  const ServiceParts& parts_;
  Arrays& arrays_;
  JobStore& store_;
  Mutex mutex_;
  std::deque<StoredJob> waiting_ ABSL_GUARDED_BY(mutex_);
  std::deque<std::shared_ptr<Job>> suspects_ ABSL_GUARDED_BY(mutex_);  // wait for another suspect
  std::shared_ptr<Job> next_ ABSL_GUARDED_BY(mutex_);                  // made from the first stored job
};

}  // namespace marble::server
