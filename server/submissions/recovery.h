// What a store held when the server was started: answers are kept on, and jobs without one wait again.
#pragma once

#include <deque>
#include <memory>

#include "mutex.h"
#include "service/service_parts.h"
#include "store/job_store.h"

namespace marble::server {

/// Jobs go to the queue in the order in which they were accepted, as it has room: with lower limits than
/// before some wait here.
class Recovery final : public RoomWaiter, public std::enable_shared_from_this<Recovery> {
 public:
  /// Before anybody calls. Errors: unavailable (the store cannot be read).
  [[nodiscard]] static Expected<std::shared_ptr<Recovery>> begin(const ServiceParts& parts, JobStore& store);

  void room() override ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  Recovery(const ServiceParts& parts, JobStore& store) : parts_(parts), store_(store) {}
  [[nodiscard]] Expected<void> take_up_answers();
  [[nodiscard]] Expected<void> take_up_jobs() ABSL_LOCKS_EXCLUDED(mutex_);
  [[nodiscard]] Expected<std::shared_ptr<Job>> remade(const StoredJob& stored) const;
  void end(const StoredJob& stored, const Error& error) const;

  const ServiceParts& parts_;
  JobStore& store_;
  Mutex mutex_;
  std::deque<StoredJob> waiting_ ABSL_GUARDED_BY(mutex_);
  std::shared_ptr<Job> next_ ABSL_GUARDED_BY(mutex_);  // of the first, once it was made
};

}  // namespace marble::server
