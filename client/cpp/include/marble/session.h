// Provides sessions: a problem is set up once on the server, and then only the changes are sent.
//
//   auto session = client->open_session(problem, options);
//   auto answer = session->solve({.b = state});   // starts from the last solution
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

/// Options of a whole session; all of them optional.
struct SessionOptions {
  Priority priority = Priority::by_method;  ///< of all its solves
  /// An update that still waits when the next one arrives is not solved: its numbers are merged into the next
  /// one.
  bool latest_only = false;
  /// Report progress to the updates' sinks.
  bool progress = false;
  double progress_interval_s = 0.0;  ///< least time between two reports, seconds, >= 0; 0: every iteration
  std::int32_t iterate_every = 0;    ///< Progress.z is set in every k-th report; 0: never
  std::span<const double> initial_z = {};  ///< n or empty: the start of the first solve
  std::string request_id = {};             ///< for the server's log; at most 128 bytes of printable ASCII
  std::string problem_name = {};           ///< for logs and dashboards; shortened to 256 bytes
  std::string traceparent = {};            ///< as CallControls::traceparent, for the whole session
  std::stop_token stop = {};               ///< cancels the whole session: everything ends with `cancelled`
  /// If the server dies or drains, solve() opens the session again in its last state, on another server if
  /// the address lists several, and its solution reports this. Keeps a copy of the problem in the client;
  /// send() is not available.
  bool reopen = false;
  /// How long solve() tries to reopen, >= 0, but at most until its update's deadline. Then it returns the
  /// error unavailable, and the next solve() tries again. A server that systemd restarts after a crash is
  /// back after five seconds.
  std::chrono::duration<double> reopen_wait = std::chrono::seconds(10);
  /// How long solve() waits for an answer after its update's deadline, in [0, 3600] s: the way of an answer,
  /// which the server sends before the deadline. No effect in process.
  std::chrono::duration<double> answer_grace = std::chrono::milliseconds(100);
};

/// Options of one update; all of them optional.
struct UpdateControls {
  std::optional<Options> options = {};     ///< from this update on; scaling_passes cannot change
  std::span<const double> initial_z = {};  ///< n or empty: start here instead of at the last solution's z
  bool cold = false;                       ///< discard the last solution
  Shift shift = {};                        ///< shifts the last solution before it is used as the start
  /// Derivatives of this solution to return with it, or null; not with a first part.
  const SensitivityRequest* sensitivity = nullptr;
  /// The latest useful time of the solution, counted from the update's arrival. A running solve ends in time:
  /// its status is time_limit, with its best point or the solution before it (`Solution::origin`), and the
  /// next solve continues from there. A solve that has not started is dropped: `deadline_exceeded`. The same
  /// error is returned SessionOptions::answer_grace after the deadline if the server is silent, as one that
  /// hangs; a later answer is discarded. After 20 such updates in a row the server counts as lost. The
  /// numbers of a dropped update and its shift take effect with the next one.
  std::optional<std::chrono::duration<double>> deadline = {};
  /// Called within next() or solve(), if the session was opened with progress; must live until the update's
  /// outcome.
  ProgressSink* progress = nullptr;
};

/// The update was replaced by a newer one, which includes its numbers.
struct Superseded {
  std::int64_t by_sequence = 0;  ///< the newer update
};

/// The outcome of one update.
struct SessionEvent {
  std::int64_t sequence = 0;  ///< of the update, as send() returned it
  /// A solution, solved or not, or the reason why there is none: superseded, or an error after which the
  /// session continues.
  std::variant<RemoteSolution, Superseded, Error> outcome;
};

/// An open session. One thread may send while another one waits in next(); otherwise use one thread at a
/// time. In process, use one thread at a time; send() solves before it returns. No call throws. An error of
/// solve() concerns that update alone, unless is_open() is false afterwards.
class Session {
 public:
  /// A moved-from object may only be assigned to or destroyed.
  Session(Session&&) noexcept;
  /// As the constructor; cancels the overwritten session, as the destructor does.
  Session& operator=(Session&&) noexcept;
  /// Cancels what has no result yet; to wait for it, call close() first.
  ~Session();

  /// Sends an update and waits for its solution. Errors: invalid_argument (fields as PartSizes::check names
  /// them), deadline_exceeded, cancelled; aborted, unavailable and others end the session. When a session
  /// with `reopen` is opened again, it starts from the last z, shifted as the update requests; the update's
  /// deadline starts anew.
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemUpdate& update = {},
                                               const UpdateControls& controls = {});

  /// Sends the first part of an update before the rest is known, and returns its number. The next update is
  /// the second part; its solution is that of one update with both parts, to the last bit. The server stores
  /// the numbers with shift, options and start, and factorizes for the branch on which the solve will begin.
  /// A first part has no result of its own; if the server rejects it, the following solve() returns the
  /// error, or next() does. An older server solves it, which takes the time of a solve; the second part then
  /// starts from that solution. If 16 messages have not left, because the server hangs, it waits for them
  /// at most the answer_grace. Errors: unavailable if they have not left then, and the part changes nothing;
  /// invalid_argument, as solve(); if the server is lost, unavailable, from here or from the following
  /// solve(), which ends the session; with `reopen` no error yet.
  [[nodiscard]] Expected<std::int64_t> prepare(const ProblemUpdate& update,
                                               const UpdateControls& controls = {});

  /// Sends an update without waiting, and returns its number; numbers ascend. Blocks while the server has the
  /// maximum number of waiting updates (64 by default), so next() must be called meanwhile. An error ends the
  /// session, except failed_precondition of a session with `reopen`.
  [[nodiscard]] Expected<std::int64_t> send(const ProblemUpdate& update = {},
                                            const UpdateControls& controls = {});

  /// Waits for the outcomes of the sent updates, in their order; returns nothing after close() and the last
  /// outcome. An error ends the session.
  [[nodiscard]] Expected<std::optional<SessionEvent>> next();

  /// Ends the session once every update has its outcome, and waits for that, but not for a server that left
  /// the last update without an answer. next() still returns outcomes that were not fetched.
  Expected<void> close();

  /// True if updates may still be sent.
  [[nodiscard]] bool is_open() const;
  /// Returns the id of the job that covers all solves; it changes when the session is reopened; empty in
  /// process.
  [[nodiscard]] const std::string& job_id() const;
  [[nodiscard]] const std::string& traceparent() const;  ///< the server's span; empty if none was sent
  [[nodiscard]] std::int64_t memory_bytes() const;       ///< as counted against the server's limits
  [[nodiscard]] double setup_s() const;                  ///< scaling, ordering, analysis, allocation
  /// The server ends the session after this time without an update; 0 in process: no limit.
  [[nodiscard]] double idle_timeout_s() const;

  struct State;  ///< internal to the client

 private:
  friend class Client;
  explicit Session(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace marble
