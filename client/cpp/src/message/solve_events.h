// Processes the events of a solve's stream, and its result.
#pragma once

#include <optional>
#include <stop_token>

#include "marble/call_controls.h"
#include "marble/error.h"
#include "marble/progress.h"
#include "marble/v1/service.pb.h"
#include "message/status.h"

namespace marble::client {

/// True if the caller requests more than the solution: this needs a stream.
[[nodiscard]] inline bool wants_events(const ProgressSink* progress, const ActivityMonitor* activity,
                                       const CallControls& call) {
  return progress != nullptr || activity != nullptr || call.accepted || call.moved || call.started;
}

class SolveEvents {
 public:
  SolveEvents(ProgressSink* progress, ActivityMonitor* activity, const CallControls& call)
      : progress_(progress), activity_(activity), call_(call) {}

  /// Passes the event to its receivers.
  void take(const v1::SolveStreamResponse& event);
  /// Returns the result, once the stream has ended successfully.
  [[nodiscard]] Expected<RemoteSolution> answer();

 private:
  ProgressSink* progress_;
  ActivityMonitor* activity_;
  const CallControls& call_;
  std::optional<RemoteSolution> answer_;
  std::int64_t skipped_ = 0;
};

/// Reads a stream to its end: each event goes to `also` first, then to its receivers.
template <class Reader, class Also>
Expected<RemoteSolution> read_events(Reader& reader, ProgressSink* progress, ActivityMonitor* activity,
                                     const CallControls& call, const std::stop_token& stop,
                                     const Also& also) {
  v1::SolveStreamResponse event;
  SolveEvents events(progress, activity, call);
  while (reader.Read(&event)) {
    also(event);
    events.take(event);
  }
  if (const grpc::Status status = reader.Finish(); !status.ok()) return unexpected(to_error(status, stop));
  return events.answer();
}

}  // namespace marble::client
