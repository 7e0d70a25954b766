#include "service/stored_job.h"

#include "base/status.h"
#include "google/rpc/status.pb.h"
#include "jobs/unix_time.h"
#include "marble/convert.h"
#include "service/job_message.h"

namespace marble::server {
namespace {

bool read_into(std::string_view bytes, google::protobuf::Message* message) {
  return !bytes.empty() && message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

}  // namespace

JobDescription description_of(const StoredJob& stored, std::string_view info) {
  v1::JobInfo message;
  if (!read_into(info, &message)) message.Clear();
  JobDescription what = description_of(message);
  what.id = stored.id;
  what.kind = stored.elements ? JobKind::array : JobKind::submitted;
  what.priority = priority_of(stored.priority);
  what.client = stored.client;
  if (!stored.request_id.empty()) what.request_id = stored.request_id;
  what.peer = stored.peer;
  what.accepted = time_of(stored.accepted_unix_s);
  return what;
}

Error set_aside(int starts) {
  const std::string times = starts == 1 ? "once" : starts == 2 ? "twice" : std::to_string(starts) + " times";
  return failure(ErrorCode::internal, "the server stopped " + times + " while it ran this job");
}

void log_set_aside(const Log& log, const StoredJob& stored, int starts) {
  log.error(Component::job, "job_set_aside",
            {{"job", stored.id},
             {"client", stored.client},
             {"request", stored.request_id},
             {"starts", std::int64_t{starts}}});
}

JobSnapshot stored_snapshot(std::string_view info) {
  v1::JobInfo message;
  if (read_into(info, &message)) return snapshot_of(message);
  JobSnapshot unreadable;
  unreadable.error = failure(ErrorCode::internal, "the stored job cannot be read");
  return unreadable;
}

JobBoard::Record stored_record(const JobBoard& board, const StoredResult& stored) {
  v1::GetJobResponse message;
  const bool whole = read_into(stored.job, &message);
  if (!whole) message.Clear();
  JobDescription what = description_of(message.job());
  what.id = stored.id;
  what.kind = stored.elements ? JobKind::array : JobKind::submitted;
  what.client = stored.client;
  auto record = board.make(std::move(what), options_of(message.options()).value_or(Options()));
  JobSnapshot snapshot = whole ? snapshot_of(message) : stored_snapshot("");
  snapshot.state = JobState::finished;
  record->restore(std::move(snapshot), trace_of(message.trace()));
  return record;
}

Expected<std::shared_ptr<v1::SolveRequest>> stored_request(std::string_view bytes) {
  auto request = std::make_shared<v1::SolveRequest>();
  if (read_into(bytes, request.get())) return request;
  return unexpected(failure(ErrorCode::internal, "the stored request cannot be read"));
}

ResultStore::Result stored_answer(std::string_view answer, std::string_view error) {
  const auto unreadable = failure(ErrorCode::internal, "the stored answer cannot be read");
  if (error.empty()) {
    if (v1::SolveResponse response; !read_into(answer, &response)) return {unexpected(unreadable), 0.0};
    const grpc::Slice slice(answer.data(), answer.size());
    return {grpc::ByteBuffer(&slice, 1), 0.0};
  }
  google::rpc::Status status;
  return {unexpected(read_into(error, &status) ? error_of(status) : unreadable), 0.0};
}

}  // namespace marble::server
