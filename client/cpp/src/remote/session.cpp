// Provides a session on its stream, and on the next one if its server died and it may be reopened.
#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "connection/connection.h"
#include "connection/traceparent.h"
#include "marble/warm_solver.h"
#include "message/answer.h"
#include "message/session_memory.h"
#include "message/session_request.h"
#include "message/status.h"
#include "mutex.h"
#include "session_state.h"

namespace marble::client {
namespace {

using Stream = grpc::ClientReaderWriter<v1::SessionRequest, v1::SessionResponse>;

using std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

// Pauses between tries to reopen, each twice as long as the one before. The first try finds a server that is
// up.
constexpr Seconds kFirstBackoff(0.1), kLongestBackoff(1.0);

// Two locks, because one thread may write a stream while another one reads. A thread whose write failed also
// takes `reading`, and reads on to learn the reason.
struct SessionStream {
  SessionStream(std::shared_ptr<const Connection> to, std::string span, std::stop_token given_up,
                std::int64_t sent_before)
      : connection(std::move(to)),
        parent(std::move(span)),
        stop(std::move(given_up)),
        sequence(sent_before) {}

  ~SessionStream();

  [[nodiscard]] Expected<void> set_up(const v1::SessionRequest& request);
  [[nodiscard]] Expected<std::int64_t> send(const ProblemUpdate& update, const UpdateControls& controls,
                                            bool first_part = false) ABSL_EXCLUSIVE_LOCKS_REQUIRED(writing);
  [[nodiscard]] std::optional<SessionEvent> read() ABSL_EXCLUSIVE_LOCKS_REQUIRED(reading);
  [[nodiscard]] std::optional<SessionEvent> event_of(const v1::SessionResponse& response);
  [[nodiscard]] Expected<RemoteSolution> solve(const ProblemUpdate& update, const UpdateControls& controls);
  [[nodiscard]] Expected<RemoteSolution> outcome_of(SessionEvent event, const ProblemUpdate& update,
                                                    const UpdateControls& controls);
  [[nodiscard]] Error reason() const { return status.ok() ? session_ended() : to_error(status, stop); }
  [[nodiscard]] bool is_first_part(std::int64_t number);
  void read_to_the_end() ABSL_EXCLUSIVE_LOCKS_REQUIRED(reading);
  void report(const v1::SessionProgress& progress);

  const std::shared_ptr<const Connection> connection;  // the stream's, as long as it exists
  const std::string parent;                            // the caller's span
  const std::stop_token stop;
  std::shared_ptr<v1::Solver::Stub> solver;
  grpc::ClientContext context;
  std::unique_ptr<Stream> stream;
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
  grpc::Status status;
  std::atomic<bool> over = false;  // set after `status`, which then does not change

  Mutex sinks_access;
  std::map<std::int64_t, ProgressSink*> sinks ABSL_GUARDED_BY(sinks_access);
  std::set<std::int64_t> first_parts ABSL_GUARDED_BY(sinks_access);  // sent since the last outcome
};

SessionStream::~SessionStream() {
  if (over || stream == nullptr) return;
  context.TryCancel();
  static_cast<void>(stream->Finish());
}

Expected<void> SessionStream::set_up(const v1::SessionRequest& request) {
  if (auto prepared = connection->prepare(context, parent, std::nullopt); !prepared) {
    over = true;
    return prepared;
  }
  cancel_on_stop.emplace(stop, [this] { context.TryCancel(); });
  epoch = request.setup().epoch();
  auto free = connection->solver_for_stream();
  if (!free) {
    over = true;
    return unexpected(free.error());
  }
  solver = *std::move(free);
  stream = solver->Session(&context);
  stream->Write(request);  // a failed write makes the read fail too
  v1::SessionResponse response;
  if (stream->Read(&response) && response.has_ready()) {
    ready = response.ready();
    connection->note_reached();
    traceparent = returned_traceparent(context);
    return {};
  }
  if (response.event_case() != v1::SessionResponse::EVENT_NOT_SET) context.TryCancel();
  status = stream->Finish();
  over = true;
  return unexpected(reason());
}

Expected<std::int64_t> SessionStream::send(const ProblemUpdate& update, const UpdateControls& controls,
                                           bool first_part) {
  if (over) return unexpected(reason());
  if (writes_done) return unexpected(session_ended());
  const auto request = make_update(epoch, sequence + 1, update, controls, first_part);
  if (!request) return unexpected(request.error());
  ++sequence;
  {
    const MutexLock lock(sinks_access);
    if (first_part) first_parts.insert(sequence);
    if (controls.progress != nullptr && !first_part) sinks[sequence] = controls.progress;
  }
  if (stream->Write(*request)) return sequence;
  writes_done = true;
  const MutexLock lock(reading);
  read_to_the_end();
  return unexpected(reason());
}

Expected<RemoteSolution> SessionStream::solve(const ProblemUpdate& update, const UpdateControls& controls) {
  const auto sent = [&] {
    const MutexLock lock(writing);
    return send(update, controls);
  }();
  if (!sent) return unexpected(sent.error());
  const MutexLock lock(reading);
  while (auto event = read()) {
    const bool own = event->sequence == *sent;
    if (own && refused_part) {
      Error error = std::get<Error>(std::exchange(refused_part, std::nullopt)->outcome);
      return unexpected(std::move(error));
    }
    if (own) return outcome_of(std::move(*event), update, controls);
    if (refused_part && event->sequence == refused_part->sequence) continue;
    unfetched.push_back(std::move(*event));
  }
  return unexpected(reason());
}

Expected<RemoteSolution> SessionStream::outcome_of(SessionEvent event, const ProblemUpdate& update,
                                                   const UpdateControls& controls) {
  auto* answer = std::get_if<RemoteSolution>(&event.outcome);
  auto* error = std::get_if<Error>(&event.outcome);
  // A rejected update has changed nothing; one that came too late has.
  const bool refused = error != nullptr &&
                       (error->code == ErrorCode::invalid_argument || error->code == ErrorCode::unavailable);
  if (memory != nullptr && !refused) memory->take(update, controls);
  if (memory != nullptr && answer != nullptr && is_solved(answer->status)) memory->take(answer->z);
  if (answer != nullptr) return std::move(*answer);
  if (error != nullptr) return unexpected(std::move(*error));
  return unexpected(failure(ErrorCode::cancelled, "a newer update took its place"));
}

std::optional<SessionEvent> SessionStream::read() {
  v1::SessionResponse response;
  while (!over && stream->Read(&response)) {
    if (response.has_progress()) report(response.progress());
    if (auto event = event_of(response)) {
      if (!is_first_part(event->sequence)) return event;
      if (!std::holds_alternative<Error>(event->outcome)) continue;  // from an older server, which solved it
      refused_part = *event;
      return event;
    }
  }
  if (!over) status = stream->Finish();
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
  RemoteSession(std::unique_ptr<SessionStream> stream, const PartSizes& sizes, Seconds wait)
      : sizes_(sizes), wait_(wait) {
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
  [[nodiscard]] Expected<void> reopen(const UpdateControls& next);

  std::unique_ptr<SessionStream> stream_;
  PartSizes sizes_;
  Seconds wait_;  // for a reopen
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
  const auto valid =
      CheckedUpdate::check(sizes_, update, {controls.initial_z, controls.cold, controls.shift});
  if (!valid) return unexpected(valid.error());
  const MutexLock lock(stream_->writing);
  auto sent = stream_->send(update, controls, true);
  if (stream_->memory == nullptr) return sent;
  const bool lost = !sent && sent.error().code == ErrorCode::unavailable;
  if (sent || lost) stream_->memory->take_first_part(update, controls);
  if (lost) return stream_->sequence;  // solve() opens the session elsewhere
  return sent;
}

Expected<std::int64_t> RemoteSession::send(const ProblemUpdate& update, const UpdateControls& controls) {
  if (stream_->memory != nullptr)
    return unexpected(failure(ErrorCode::failed_precondition, "reopen", "leaves only solve()"));
  const MutexLock lock(stream_->writing);
  return stream_->send(update, controls);
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
  auto answer = stream_->solve(update, controls);
  const auto lost = [&] {
    return stream_->memory != nullptr && !answer && answer.error().code == ErrorCode::unavailable;
  };
  const auto begin = steady_clock::now();
  const Seconds most = controls.deadline ? std::min(wait_, *controls.deadline) : wait_;
  for (Seconds backoff = kFirstBackoff; lost(); backoff = std::min(2.0 * backoff, kLongestBackoff)) {
    if (auto again = reopen(controls); !again) {
      answer = unexpected(again.error());
    } else if (answer = stream_->solve(update, controls); answer) {
      answer->reopened = true;
    }
    const Seconds left = most - (steady_clock::now() - begin);
    if (!lost() || left <= Seconds(0.0)) break;
    static_cast<void>(stream_->connection->pause(std::min(backoff, left), stream_->stop));
  }
  return answer;
}

Expected<void> RemoteSession::reopen(const UpdateControls& next) {
  std::int64_t sent = 0;
  {
    const MutexLock lock(stream_->writing);
    sent = stream_->sequence;
  }
  stream_->memory->count_epoch();
  auto stream = std::make_unique<SessionStream>(stream_->connection, stream_->parent, stream_->stop, sent);
  if (auto made = stream->set_up(stream_->memory->setup(next)); !made) return made;
  stream->memory = std::move(stream_->memory);
  take(std::move(stream));
  return {};
}

Expected<void> RemoteSession::close() {
  SessionStream& s = *stream_;
  {
    const MutexLock lock(s.writing);
    if (!s.writes_done) s.stream->WritesDone();
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
  auto request = make_setup(problem, options, session);
  if (!request) return unexpected(request.error());
  auto stream = std::make_unique<SessionStream>(std::move(connection), session.traceparent, session.stop, 0);
  if (auto made = stream->set_up(*request); !made) return unexpected(made.error());
  if (session.reopen) stream->memory = std::make_unique<SessionMemory>(std::move(*request));
  PartSizes sizes;
#define MARBLE_VECTOR(letter, field) sizes.letter = problem.letter.size();
#define MARBLE_MATRIX(letter, field, update, vector) sizes.letter = problem.letter.values.size();
#include "marble/contract.def"
  return std::make_unique<RemoteSession>(std::move(stream), sizes, session.reopen_wait);
}

}  // namespace marble::client
