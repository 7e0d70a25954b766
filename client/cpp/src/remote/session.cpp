// Provides a session on its stream, and on the next one if its server died and it may be reopened.
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "connection/connection.h"
#include "connection/traceparent.h"
#include "marble/warm_solver.h"
#include "message/answer.h"
#include "message/session_request.h"
#include "message/status.h"
#include "mutex.h"
#include "remote/session_wire.h"
#include "session_state.h"

namespace marble::client {
namespace {

using Clock = SessionWire::Clock;
using Seconds = std::chrono::duration<double>;

// Pauses between tries to reopen, each twice as long as the one before. The first try finds a server that is
// up.
constexpr Seconds kFirstBackoff(0.1), kLongestBackoff(1.0);
constexpr Seconds kLongestWait(1e8);  // the range of the clock is limited
// Updates in a row that a server may leave unanswered beyond their deadlines.
constexpr int kMostMisses = 20;

[[nodiscard]] Error not_answered(const UpdateControls& controls, Seconds grace) {
  char text[128];
  std::snprintf(text, sizeof text, "the server did not answer within %g s, %g s after the deadline",
                (*controls.deadline + grace).count(), grace.count());
  return failure(ErrorCode::deadline_exceeded, text);
}

[[nodiscard]] Error not_opened() {
  return failure(ErrorCode::unavailable, "the session was not opened again in time");
}

// Two locks, because one thread may write a stream while another one reads. A thread whose write failed also
// takes `reading`, and reads on to learn the reason.
struct SessionStream {
  SessionStream(std::shared_ptr<const Connection> to, std::string span, std::stop_token given_up,
                std::int64_t sent_before)
      : connection(std::move(to)),
        parent(std::move(span)),
        stop(std::move(given_up)),
        sequence(sent_before) {}

  [[nodiscard]] Expected<void> begin(v1::SessionRequest setup);
  // Returns false if `end` comes before the session is set up; the next call waits further.
  [[nodiscard]] Expected<bool> await_ready(Clock::time_point end);
  [[nodiscard]] Expected<std::int64_t> send(const ProblemUpdate& update, const UpdateControls& controls,
                                            bool first_part = false) ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing);
  [[nodiscard]] Expected<std::int64_t> send_first_part(const ProblemUpdate& update,
                                                       const UpdateControls& controls, Seconds grace)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing);
  [[nodiscard]] Expected<void> wait_sent() ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing);
  // Returns nothing at the end of the stream, or if `end` comes before: then `over` is not set.
  [[nodiscard]] std::optional<SessionEvent> read(Clock::time_point end = SessionWire::kForever)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(reading);
  [[nodiscard]] std::optional<SessionEvent> event_of(const v1::SessionResponse& response);
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemUpdate& update, const UpdateControls& controls,
                                               Clock::time_point end, Seconds grace);
  [[nodiscard]] Expected<RemoteSolution> outcome_of(SessionEvent event, const ProblemUpdate& update,
                                                    const UpdateControls& controls);
  [[nodiscard]] Error reason() const { return status.ok() ? session_ended() : to_error(status, stop); }
  [[nodiscard]] bool is_first_part(std::int64_t number);
  void read_to_the_end() ABSL_EXCLUSIVE_LOCKS_REQUIRED(reading);
  void miss(std::int64_t number) ABSL_EXCLUSIVE_LOCKS_REQUIRED(reading);
  void report(const v1::SessionProgress& progress);

  const std::shared_ptr<const Connection> connection;  // the stream's, as long as it exists
  const std::string parent;                            // the caller's span
  const std::stop_token stop;
  std::shared_ptr<v1::Solver::Stub> solver;
  grpc::ClientContext context;
  std::optional<SessionWire> wire;
  std::optional<std::stop_callback<std::function<void()>>> cancel_on_stop;
  v1::SessionReady ready;
  std::int64_t epoch = 0;
  std::string traceparent;
  std::unique_ptr<SessionMemory> memory;  // only if it may be reopened

  Mutex writing;
  std::int64_t sequence ABSL_GUARDED_BY(writing);
  bool writes_done ABSL_GUARDED_BY(writing) = false;

  Mutex reading;
  std::deque<SessionEvent> unfetched ABSL_GUARDED_BY(reading);
  std::optional<SessionEvent> refused_part ABSL_GUARDED_BY(reading);  // a rejected first part, with its error
  std::set<std::int64_t> discarded ABSL_GUARDED_BY(reading);          // updates whose outcomes are discarded
  std::atomic<int> misses = 0;                                        // in a row; without any answer
  std::atomic<bool> last_missed = false;                              // no answer has come since
  grpc::Status status;
  std::atomic<bool> over = false;  // set after `status`, which then does not change

  Mutex sinks_access;
  std::map<std::int64_t, ProgressSink*> sinks ABSL_GUARDED_BY(sinks_access);
  std::set<std::int64_t> first_parts ABSL_GUARDED_BY(sinks_access);  // sent since the last outcome
  std::set<std::int64_t> awaited ABSL_GUARDED_BY(sinks_access);      // others without an outcome
};

Expected<void> SessionStream::begin(v1::SessionRequest setup) {
  if (auto prepared = connection->prepare(context, parent, std::nullopt); !prepared) {
    over = true;
    return prepared;
  }
  cancel_on_stop.emplace(stop, [this] { context.TryCancel(); });
  epoch = setup.setup().epoch();
  auto free = connection->solver_for_stream();
  if (!free) {
    over = true;
    return unexpected(free.error());
  }
  solver = *std::move(free);
  wire.emplace(*solver, context);
  wire->write(std::move(setup));  // a failed write makes the read fail too
  return {};
}

Expected<bool> SessionStream::await_ready(Clock::time_point end) {
  v1::SessionResponse response;
  const SessionWire::Outcome read = wire->read(&response, end);
  if (read == SessionWire::Outcome::late) return false;
  if (read == SessionWire::Outcome::done && response.has_ready()) {
    ready = response.ready();
    connection->note_reached();
    traceparent = returned_traceparent(context);
    return true;
  }
  if (response.event_case() != v1::SessionResponse::EVENT_NOT_SET) context.TryCancel();
  status = wire->finish();
  over = true;
  return unexpected(reason());
}

Expected<std::int64_t> SessionStream::send(const ProblemUpdate& update, const UpdateControls& controls,
                                           bool first_part) {
  if (over) return unexpected(reason());
  if (writes_done) return unexpected(session_ended());
  MARBLE_ASSIGN_OR_RETURN(auto request, make_update(epoch, sequence + 1, update, controls, first_part));
  ++sequence;
  {
    const MutexLock lock(sinks_access);
    (first_part ? first_parts : awaited).insert(sequence);
    if (controls.progress != nullptr && !first_part) sinks[sequence] = controls.progress;
  }
  wire->write(std::move(request));
  return sequence;
}

// A caller that only prepares would otherwise fill the memory while the server hangs.
Expected<std::int64_t> SessionStream::send_first_part(const ProblemUpdate& update,
                                                      const UpdateControls& controls, Seconds grace) {
  if (!over && !wire->wait_room(Clock::now() + std::chrono::duration_cast<Clock::duration>(grace))) {
    return unexpected(failure(ErrorCode::unavailable, std::to_string(SessionWire::kMostUnsent) +
                                                          " messages wait for the server to receive them"));
  }
  return send(update, controls, true);
}

Expected<void> SessionStream::wait_sent() {
  if (wire->wait_written()) return {};
  writes_done = true;
  const MutexLock lock(reading);
  read_to_the_end();
  return unexpected(reason());
}

Expected<RemoteSolution> SessionStream::solve(const ProblemUpdate& update, const UpdateControls& controls,
                                              Clock::time_point end, Seconds grace) {
  const auto sent = [&] {
    const MutexLock lock(writing);
    return send(update, controls);
  }();
  if (!sent) return unexpected(sent.error());
  const MutexLock lock(reading);
  while (auto event = read(end)) {
    const bool own = event->sequence == *sent;
    if (own && refused_part) {
      Error error = std::get<Error>(std::exchange(refused_part, std::nullopt)->outcome);
      return unexpected(std::move(error));
    }
    if (own) return outcome_of(std::move(*event), update, controls);
    if (refused_part && event->sequence == refused_part->sequence) continue;
    unfetched.push_back(std::move(*event));
  }
  if (over) return unexpected(reason());
  miss(*sent);
  return unexpected(not_answered(controls, grace));
}

void SessionStream::miss(std::int64_t number) {
  last_missed = true;
  discarded.insert(number);
  {
    const MutexLock lock(sinks_access);
    sinks.erase(number);
    awaited.erase(number);
    if (!awaited.empty() && *awaited.begin() < number)
      return;  // a server that solves an earlier update need not hang
  }
  if (++misses < kMostMisses) return;
  context.TryCancel();
  static_cast<void>(wire->finish());
  status = {grpc::StatusCode::UNAVAILABLE,
            "the server left " + std::to_string(kMostMisses) + " updates in a row without an answer"};
  over = true;
}

Expected<RemoteSolution> SessionStream::outcome_of(SessionEvent event, const ProblemUpdate& update,
                                                   const UpdateControls& controls) {
  auto* answer = std::get_if<RemoteSolution>(&event.outcome);
  auto* error = std::get_if<Error>(&event.outcome);
  // A rejected update has changed nothing. RemoteSession takes one that came too late.
  const bool refused = error != nullptr &&
                       (error->code == ErrorCode::invalid_argument ||
                        error->code == ErrorCode::deadline_exceeded || error->code == ErrorCode::unavailable);
  if (memory != nullptr && !refused) memory->take(update, controls);
  if (memory != nullptr && answer != nullptr && is_solved(answer->status)) memory->take(answer->z);
  if (answer != nullptr) return std::move(*answer);
  if (error != nullptr) return unexpected(std::move(*error));
  return unexpected(failure(ErrorCode::cancelled, "a newer update took its place"));
}

std::optional<SessionEvent> SessionStream::read(Clock::time_point end) {
  v1::SessionResponse response;
  while (!over) {
    const SessionWire::Outcome read = wire->read(&response, end);
    if (read == SessionWire::Outcome::late) return std::nullopt;
    if (read == SessionWire::Outcome::over) break;
    if (response.has_progress()) report(response.progress());
    if (auto event = event_of(response)) {
      misses = 0;
      last_missed = false;
      if (discarded.erase(event->sequence) != 0) {
        refused_part.reset();
        continue;
      }
      if (!is_first_part(event->sequence)) return event;
      if (!std::holds_alternative<Error>(event->outcome)) continue;  // from an older server, which solved it
      refused_part = *event;
      return event;
    }
  }
  if (!over) status = wire->finish();
  over = true;
  return std::nullopt;
}

// Removes the earlier ones, which have had their chance to fail.
bool SessionStream::is_first_part(std::int64_t number) {
  const MutexLock lock(sinks_access);
  const bool first_part = first_parts.count(number) != 0;
  first_parts.erase(first_parts.begin(), first_parts.upper_bound(number));
  return first_part;
}

void SessionStream::read_to_the_end() {
  while (auto event = read()) unfetched.push_back(std::move(*event));
}

std::optional<SessionEvent> SessionStream::event_of(const v1::SessionResponse& response) {
  std::optional<SessionEvent> event;
  if (response.has_answer()) {
    const v1::SessionAnswer& answer = response.answer();
    RemoteSolution solution = remote_solution(answer.solution(), ready.job_id());
    solution.traceparent = traceparent;
    event = {answer.sequence(), std::move(solution)};
  } else if (response.has_superseded()) {
    event = {response.superseded().sequence(), Superseded{response.superseded().by_sequence()}};
  } else if (response.has_error()) {
    event = {response.error().sequence(), to_error(response.error().status())};
  }
  if (event) {
    const MutexLock lock(sinks_access);
    sinks.erase(event->sequence);
    awaited.erase(event->sequence);
  }
  return event;
}

void SessionStream::report(const v1::SessionProgress& progress) {
  ProgressSink* sink = nullptr;
  {
    const MutexLock lock(sinks_access);
    if (const auto found = sinks.find(progress.sequence()); found != sinks.end()) sink = found->second;
  }
  if (sink == nullptr) return;
  for (const v1::Progress& row : progress.progress().rows()) sink->report(progress_of(row));
}

class RemoteSession final : public Session::State {
 public:
  RemoteSession(std::unique_ptr<SessionStream> stream, const PartSizes& sizes, Seconds wait, Seconds grace)
      : sizes_(sizes), wait_(wait), grace_(grace) {
    take(std::move(stream));
  }

  Expected<RemoteSolution> solve(const ProblemUpdate& update, const UpdateControls& controls) override;
  Expected<std::int64_t> prepare(const ProblemUpdate& update, const UpdateControls& controls) override;
  Expected<std::int64_t> send(const ProblemUpdate& update, const UpdateControls& controls) override;
  Expected<std::optional<SessionEvent>> next() override;
  Expected<void> close() override;
  [[nodiscard]] bool is_open() const override { return !stream_->over; }

 private:
  void take(std::unique_ptr<SessionStream> stream);
  [[nodiscard]] Expected<void> reopen(const UpdateControls& next, Clock::time_point end);
  [[nodiscard]] Expected<void> check(const ProblemUpdate& update, const UpdateControls& controls) const {
    MARBLE_RETURN_IF_ERROR(
        CheckedUpdate::check(sizes_, update, {controls.initial_z, controls.cold, controls.shift}));
    return {};
  }

  std::unique_ptr<SessionStream> stream_, opening_;  // the second is not set up yet
  Clock::time_point opening_since_;
  PartSizes sizes_;
  Seconds wait_;   // for a reopen
  Seconds grace_;  // after a deadline, for the answer's way
};

void RemoteSession::take(std::unique_ptr<SessionStream> stream) {
  stream_ = std::move(stream);
  const v1::SessionReady& ready = stream_->ready;
  job_id = ready.job_id();
  traceparent = stream_->traceparent;
  memory_bytes = ready.memory_bytes();
  setup_s = ready.setup_s();
  idle_timeout_s = ready.idle_timeout_s();
}

// Checked here: no one waits to receive the server's error.
Expected<std::int64_t> RemoteSession::prepare(const ProblemUpdate& update, const UpdateControls& controls) {
  MARBLE_RETURN_IF_ERROR(check(update, controls));
  // A set-up that is under way was sent without these numbers; they follow it.
  SessionStream& stream = opening_ != nullptr ? *opening_ : *stream_;
  const MutexLock lock(stream.writing);
  auto sent = stream.send_first_part(update, controls, grace_);
  if (stream_->memory == nullptr) return sent;
  const bool lost = !sent && stream.over && sent.error().code == ErrorCode::unavailable;
  if (sent || lost) stream_->memory->take_first_part(update, controls);
  if (lost) return stream.sequence;  // solve() opens the session elsewhere
  return sent;
}

Expected<std::int64_t> RemoteSession::send(const ProblemUpdate& update, const UpdateControls& controls) {
  if (stream_->memory != nullptr)
    return unexpected(failure(ErrorCode::failed_precondition, "reopen", "leaves only solve()"));
  const MutexLock lock(stream_->writing);
  MARBLE_ASSIGN_OR_RETURN(auto sent, stream_->send(update, controls));
  MARBLE_RETURN_IF_ERROR(stream_->wait_sent());
  return sent;
}

Expected<std::optional<SessionEvent>> RemoteSession::next() {
  SessionStream& s = *stream_;
  const MutexLock lock(s.reading);
  if (!s.unfetched.empty()) {
    std::optional<SessionEvent> event = std::move(s.unfetched.front());
    s.unfetched.pop_front();
    return event;
  }
  auto event = s.read();
  s.refused_part.reset();  // reported
  if (!event && !s.status.ok()) return unexpected(s.reason());
  return event;
}

Expected<RemoteSolution> RemoteSession::solve(const ProblemUpdate& update, const UpdateControls& controls) {
  const Seconds longest =
      controls.deadline ? std::max(*controls.deadline, Seconds(0.0)) + grace_ : kLongestWait;
  const auto end = longest < kLongestWait
                       ? Clock::now() + std::chrono::duration_cast<Clock::duration>(longest)
                       : SessionWire::kForever;
  // A server is left for good once a set-up on the next one is under way, to which first parts are sent.
  auto answer = opening_ == nullptr ? stream_->solve(update, controls, end, grace_)
                                    : Expected<RemoteSolution>(unexpected(not_opened()));
  const auto lost = [&] {
    return stream_->memory != nullptr && !answer && answer.error().code == ErrorCode::unavailable;
  };
  const auto begin = Clock::now();
  const Seconds most = controls.deadline ? std::min(wait_, *controls.deadline) : wait_;
  for (Seconds backoff = kFirstBackoff; lost(); backoff = std::min(2.0 * backoff, kLongestBackoff)) {
    if (auto again = reopen(controls, end); !again) {
      answer = unexpected(again.error());
    } else if (answer = stream_->solve(update, controls, end, grace_); answer) {
      answer->reopened = true;
    }
    const Seconds left = most - (Clock::now() - begin);
    if (!lost() || left <= Seconds(0.0)) break;
    static_cast<void>(stream_->connection->pause(std::min(backoff, left), stream_->stop));
  }
  // The numbers of an update that came too late are kept, and so is its shift.
  if (stream_->memory != nullptr && !answer && answer.error().code == ErrorCode::deadline_exceeded &&
      check(update, controls))
    stream_->memory->take_first_part(update, controls);
  return answer;
}

Expected<void> RemoteSession::reopen(const UpdateControls& next, Clock::time_point end) {
  if (opening_ == nullptr) {
    std::int64_t sent = 0;
    {
      const MutexLock lock(stream_->writing);
      sent = stream_->sequence;
    }
    stream_->memory->count_epoch();
    opening_since_ = Clock::now();
    opening_ = std::make_unique<SessionStream>(stream_->connection, stream_->parent, stream_->stop, sent);
    if (auto begun = opening_->begin(stream_->memory->setup(next)); !begun) {
      opening_.reset();
      return begun;
    }
  }
  // One that takes much longer than the last server counts as one that hangs.
  const Seconds longest = std::min(kLongestWait, std::max(Seconds(1.0), Seconds(1.0 + 10.0 * setup_s)));
  const auto hangs = opening_since_ + std::chrono::duration_cast<Clock::duration>(longest);
  const auto made = opening_->await_ready(std::min(end, hangs));
  if (made && !*made) {
    if (Clock::now() >= hangs) opening_.reset();
    return unexpected(not_opened());
  }
  auto opened = std::move(opening_);
  if (!made) return unexpected(made.error());
  opened->memory = std::move(stream_->memory);
  take(std::move(opened));
  return {};
}

Expected<void> RemoteSession::close() {
  opening_.reset();
  SessionStream& s = *stream_;
  if (s.last_missed) {  // the server may hang
    s.context.TryCancel();
    const MutexLock lock(s.reading);
    s.read_to_the_end();
    return {};
  }
  {
    const MutexLock lock(s.writing);
    if (!s.writes_done) s.wire->writes_done();
    s.writes_done = true;
  }
  const MutexLock lock(s.reading);
  s.read_to_the_end();
  if (!s.status.ok()) return unexpected(s.reason());
  return {};
}

}  // namespace

Expected<std::unique_ptr<Session::State>> open_remote_session(std::shared_ptr<const Connection> connection,
                                                              const ProblemView& problem,
                                                              const Options& options,
                                                              const SessionOptions& session) {
  MARBLE_ASSIGN_OR_RETURN(auto request, make_setup(problem, options, session));
  auto stream = std::make_unique<SessionStream>(std::move(connection), session.traceparent, session.stop, 0);
  MARBLE_RETURN_IF_ERROR(stream->begin(session.reopen ? request : std::move(request)));
  MARBLE_RETURN_IF_ERROR(stream->await_ready(SessionWire::kForever));
  if (session.reopen) stream->memory = std::make_unique<SessionMemory>(std::move(request));
  PartSizes sizes;
#define MARBLE_VECTOR(letter, field) sizes.letter = problem.letter.size();
#define MARBLE_MATRIX(letter, field, update, vector) sizes.letter = problem.letter.values.size();
#include "marble/contract.def"
  return std::make_unique<RemoteSession>(std::move(stream), sizes, session.reopen_wait, session.answer_grace);
}

}  // namespace marble::client
