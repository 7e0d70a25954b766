// Sends requests as separate calls: Solve and SolveStream.
#pragma once

#include <set>

#include "load_target.h"
#include "mutex.h"
#include "work.h"
#include "workload.h"

namespace marble::load {

class CallLane : public Lane {
 public:
  /// All arguments outlive the lane. `entry` selects the method.
  CallLane(const Target& target, const LoadedEntry& entry, const Done& done);
  /// Cancels the calls in progress, and waits for their end.
  ~CallLane() override;

  void send(const Work& work) override;
  void cancel() override;

 private:
  friend class UnaryCall;
  friend class StreamedCall;
  void begun(grpc::ClientContext* context);
  void over(grpc::ClientContext* context);

  const Target& target_;
  const LoadedEntry& entry_;
  const Done& done_;
  Mutex mutex_;
  Condition ended_;
  std::set<grpc::ClientContext*> under_way_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::load
