#include "service/job_bundle.h"

#include "service/job_access.h"
#include "service/job_message.h"
#include "store/submissions.h"

namespace marble::server {
namespace {

Expected<void> check_access(const ServiceParts& parts, const Identity& caller, const std::string& id) {
  const std::string owner = parts.results.owner(id);
  if (owner.empty()) {
    MARBLE_RETURN_IF_ERROR(find_job(parts.board, caller, id));
    return unexpected(failure(ErrorCode::failed_precondition, "job_id", id,
                              "has no bundle: only submitted jobs have one, while they are kept (marble "
                              "solve --bundle makes one of any "
                              "solve)"));
  }
  if (!may_see(caller, owner)) return unexpected(no_such_job(id));
  if (may_end(caller, owner)) return {};
  return unexpected(failure(ErrorCode::permission_denied, "job_id", id,
                            "is another client's job; its problem is for that client and the role admin"));
}

// Returns a bundle that counts for this client until it is released.
Expected<std::shared_ptr<Bundle>> counted_bundle(const ServiceParts& parts, const std::string& client) {
  const auto limit = parts.bundles;
  MARBLE_RETURN_IF_ERROR(limit->enter(client, parts.access.quota_of(client).bundles));
  return std::shared_ptr<Bundle>(new Bundle, [limit, client](Bundle* bundle) {
    delete bundle;
    limit->leave(client);
  });
}

}  // namespace

void gather_bundle(const ServiceParts& parts, const Identity& caller, const std::string& id,
                   const std::function<void(Expected<GatheredBundle>)>& then) {
  if (auto allowed = check_access(parts, caller, id); !allowed) return then(unexpected(allowed.error()));
  const auto counted = counted_bundle(parts, caller.client);
  if (!counted) return then(unexpected(counted.error()));
  const std::shared_ptr<Bundle> bundle = *counted;
  report_build(&bundle->facts);
  const auto record = parts.board.find(id);
  v1::GetJobResponse* job = bundle->facts.mutable_job();
  if (record != nullptr) {
    to_message(*record, job);
  } else {  // the board has dropped it, but its result exists
    job->mutable_job()->set_job_id(id);
    job->mutable_job()->set_state(v1::JOB_STATE_FINISHED);
  }
  make_anonymous(&bundle->facts);
  const bool finished = job->job().state() == v1::JOB_STATE_FINISHED;
  parts.submissions->fetch_pair(id, finished, [bundle, then](Expected<AskedAndAnswered> both) {
    if (!both) return then(unexpected(both.error()));
    bundle->request = std::move(both->request);
    bundle->answer = std::move(both->answer);
    make_anonymous(&bundle->request);
    bundle->facts.set_request_bytes(static_cast<std::int64_t>(bundle->request.size()));
    bundle->facts.set_answer_bytes(static_cast<std::int64_t>(bundle->answer.size()));
    then(GatheredBundle(bundle));
  });
}

}  // namespace marble::server
