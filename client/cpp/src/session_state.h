// Provides the interface behind a Session: a stream to a server, or a solver in this process.
#pragma once

#include "marble/session.h"

namespace marble {

/// The functions of Session with these names, but they may throw bad_alloc.
struct Session::State {
  virtual ~State() = default;
  [[nodiscard]] virtual Expected<RemoteSolution> solve(const ProblemUpdate& update,
                                                       const UpdateControls& controls) = 0;
  [[nodiscard]] virtual Expected<std::int64_t> prepare(const ProblemUpdate& update,
                                                       const UpdateControls& controls) = 0;
  [[nodiscard]] virtual Expected<std::int64_t> send(const ProblemUpdate& update,
                                                    const UpdateControls& controls) = 0;
  [[nodiscard]] virtual Expected<std::optional<SessionEvent>> next() = 0;
  virtual Expected<void> close() = 0;
  [[nodiscard]] virtual bool is_open() const = 0;

  // Set when the session is opened.
  std::string job_id;
  std::string traceparent;
  std::int64_t memory_bytes = 0;
  double setup_s = 0.0;
  double idle_timeout_s = 0.0;
};

namespace client {

class Connection;

[[nodiscard]] Expected<std::unique_ptr<Session::State>> open_remote_session(
    std::shared_ptr<const Connection> connection, const ProblemView& problem, const Options& options,
    const SessionOptions& session);

[[nodiscard]] Expected<std::unique_ptr<Session::State>> open_session_in_process(
    const ProblemView& problem, const Options& options, const SessionOptions& session);

[[nodiscard]] inline Error session_ended() {
  return failure(ErrorCode::failed_precondition, "the session has ended");
}

}  // namespace client
}  // namespace marble
