// One problem again and again: set up once on the server, then only what changes is sent.
//
//   auto session = client->open_session(problem, options);
//   auto answer = session->solve({.b = state});   // starts from the last answer
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <variant>

#include "marble/call_controls.h"
#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/restart.h"
#include "marble/sensitivity.h"

namespace marble {

namespace client {
class Connection;
}

/// What holds for a session as a whole; all of it optional.
struct SessionOptions {
  Priority priority = Priority::by_method;  ///< of all its solves
  /// An update that still waits when the next one comes is not solved: the next one takes its numbers along.
  bool latest_only = false;
  /// Report progress to the updates' sinks.
  bool progress = false;
  double progress_interval_s = 0.0;  ///< least time between two reports, seconds, >= 0; 0: every iteration
  std::int32_t iterate_every = 0;    ///< Progress.z is there in every k-th report; 0: never
  std::span<const double> initial_z = {};  ///< n or empty: where the first solve starts
  std::string request_id = {};             ///< for the server's log; at most 128 bytes of printable ASCII
  std::string problem_name = {};           ///< for logs and dashboards; shortened to 256 bytes
  std::string traceparent = {};            ///< as CallControls has it, of the whole session
  std::stop_token stop = {};               ///< gives the whole session up: everything ends with `cancelled`
  /// If the server dies or drains, solve() sets the session up again as it was, on another server where the
  /// address has several, and says so in its answer. Keeps a copy of the problem here, and leaves no send().
  bool reopen = false;
  /// For how long solve() tries that, >= 0, but no longer than its update's deadline; then it gives the error
  /// unavailable, and the next solve() tries again. A server that systemd restarts after a crash is back
  /// after five seconds.
  std::chrono::duration<double> reopen_wait = std::chrono::seconds(10);
};

/// What may accompany one update; all of it optional.
struct UpdateControls {
  std::optional<Options> options = {};     ///< from here on; scaling_passes stays as it was set up
  std::span<const double> initial_z = {};  ///< n or empty: start here instead of at the last answer's z
  bool cold = false;                       ///< forget the last answer
  Shift shift = {};                        ///< the last answer moves on before it is started from
  /// Derivatives of this answer that are wanted with it, or none; not of a first part.
  const SensitivityRequest* sensitivity = nullptr;
  /// No answer is wanted later than this after the update's arrival. A solve that has begun ends in time: its
  /// answer is one of status time_limit, with its best point or the solution before it (`Solution::origin`),
  /// and the next solve goes on where it was. One that has not begun never does: `deadline_exceeded`.
  std::optional<std::chrono::duration<double>> deadline = {};
  /// Told within next() or solve(), if the session was opened with progress; must live until the update's
  /// outcome.
  ProgressSink* progress = nullptr;
};

/// The update was overtaken by a newer one, which took its numbers along.
struct Superseded {
  std::int64_t by_sequence = 0;  ///< the newer one
};

/// What came of one update.
struct SessionEvent {
  std::int64_t sequence = 0;  ///< of the update, as send() returned it
  /// An answer, solved or not; or why there is none: overtaken, or an error after which the session goes on.
  std::variant<RemoteSolution, Superseded, Error> outcome;
};

/// An open session. One thread may send while another one waits in next(); else one thread at a time. In
/// process it is always one at a time, and send() solves before it returns. No call throws. An error of
/// solve() concerns that update alone, unless is_open() is false afterwards.
class Session {
 public:
  /// What was moved from may only be assigned to or destroyed.
  Session(Session&&) noexcept;
  /// As the constructor; what was there is given up, as the destructor does.
  Session& operator=(Session&&) noexcept;
  /// Gives up what is not answered; close() first where that matters.
  ~Session();

  /// Sends an update and waits for its answer. Errors: invalid_argument (fields as PartSizes::check names
  /// them), deadline_exceeded, cancelled; aborted, unavailable and others end the session. A session with
  /// `reopen` that is set up again starts from the last z, moved on as the update says; the update's deadline
  /// begins anew.
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemUpdate& update = {},
                                               const UpdateControls& controls = {});

  /// Sends the first part of an update ahead of what is not known yet, and returns its number: the next
  /// update is the second part, and its answer that of one update of both, to the last bit. The server takes
  /// the numbers in, with shift, options and start, and factorizes for the branch that the solve will begin
  /// on. Nothing is answered; what the server refuses of it is the error of the solve() that follows, or
  /// comes from next(). An older server solves it, which costs its time; the second part then begins at that
  /// solution. Errors: invalid_argument, as solve() has them; of a server that is lost, unavailable, which
  /// ends the session, or with `reopen` nothing yet.
  [[nodiscard]] Expected<std::int64_t> prepare(const ProblemUpdate& update,
                                               const UpdateControls& controls = {});

  /// Sends an update without waiting, and returns its number; numbers ascend. Blocks while the server has as
  /// many waiting as it takes (64 by default), so next() must be called meanwhile. An error ends the session,
  /// but for failed_precondition of one with `reopen`.
  [[nodiscard]] Expected<std::int64_t> send(const ProblemUpdate& update = {},
                                            const UpdateControls& controls = {});

  /// Waits for what comes of the updates sent, in their order; nothing after close() and the last of them. An
  /// error is the session's end.
  [[nodiscard]] Expected<std::optional<SessionEvent>> next();

  /// Ends the session once everything is answered, and waits for that. next() still gives what was not
  /// fetched.
  Expected<void> close();

  /// Whether updates may still be sent.
  [[nodiscard]] bool is_open() const;
  /// One job for all its solves; another one once it was reopened; empty in process.
  [[nodiscard]] const std::string& job_id() const;
  [[nodiscard]] const std::string& traceparent() const;  ///< the server's span; empty if none was sent
  [[nodiscard]] std::int64_t memory_bytes() const;       ///< as it is counted against the server's limits
  [[nodiscard]] double setup_s() const;                  ///< scaling, ordering, analysis, allocation
  /// Without an update for this long the server ends it; 0 in process, where nothing does.
  [[nodiscard]] double idle_timeout_s() const;

  struct State;  ///< the client's own

 private:
  friend class Client;
  explicit Session(std::unique_ptr<State> state);
  [[nodiscard]] static Expected<Session> open(std::shared_ptr<const client::Connection> connection,
                                              const ProblemView& problem, const Options& options,
                                              const SessionOptions& session);
  std::unique_ptr<State> state_;
};

}  // namespace marble
