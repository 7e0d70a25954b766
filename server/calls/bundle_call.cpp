#include "calls/bundle_call.h"

#include <algorithm>
#include <sstream>

#include "base/status.h"
#include "base/wire.h"
#include "service/admission.h"

namespace marble::server {
namespace {

constexpr std::size_t kPiece = 1 << 20;  // bytes; as specified by the contract

// Returns the next piece of `all`, of which `reported` bytes were sent.
std::string next_piece(const std::string& all, std::size_t& reported, std::size_t most) {
  std::string piece = all.substr(reported, most);
  reported += piece.size();
  return piece;
}

}  // namespace

grpc::ServerWriteReactor<grpc::ByteBuffer>* BundleCall::begin(const ServiceParts& parts,
                                                              grpc::CallbackServerContext& context,
                                                              const grpc::ByteBuffer* request) {
  const std::shared_ptr<BundleCall> call(new BundleCall(parts, context));
  call->self_ = call;
  if (const auto started = call->start(request); !started)
    call->end_at_once(to_status(started.error(), parts.scheduler.retry_delay_s()));
  return call.get();
}

Expected<void> BundleCall::start(const grpc::ByteBuffer* request) {
  Origin origin = origin_of(context_);
  MARBLE_ASSIGN_OR_RETURN(const auto caller, identify(parts_, context_, origin));
  v1::JobBundleRequest message;
  MARBLE_RETURN_IF_ERROR(parse(request, &message));
  const auto self = self_;  // gRPC may be done with the call before this returns
  parts_.timer.add(self);
  gather_bundle(parts_, caller, message.job_id(),
                [self](const Expected<GatheredBundle>& bundle) { self->gathered(bundle); });
  return {};
}

void BundleCall::gathered(const Expected<GatheredBundle>& bundle) {
  {
    const MutexLock lock(mutex_);
    if (bundle) {
      bundle_ = *bundle;
    } else {
      fault_ = bundle.error();
    }
  }
  go_on();
}

// The place is released as soon as the client is too slow. The error follows the piece in transit; a client
// that does not read that either is disconnected.
void BundleCall::on_timer(Clock::time_point now) {
  bool cuts = false;
  {
    const MutexLock lock(mutex_);
    const double waits_s = std::chrono::duration<double>(now - piece_since_).count();
    const double most_s = parts_.config.bundle_idle_s;
    if (writing() && bundle_ != nullptr && waits_s > most_s) {
      bundle_.reset();
      std::ostringstream rule;
      rule << "a piece of a bundle must be taken within " << most_s << " s";
      fault_ = failure(ErrorCode::deadline_exceeded, "bundle_idle_s", rule.str());
    }
    cuts = writing() && fault_ && waits_s > 2.0 * most_s;
  }
  if (cuts) cut(context_);
  go_on();
}

bool BundleCall::next_event(v1::JobBundleResponse* event) {
  if (bundle_ == nullptr) return false;
  piece_since_ = Clock::now();
  const std::size_t most = std::min(kPiece, static_cast<std::size_t>(parts_.config.message_bytes) / 2);
  if (!std::exchange(began_, true)) {
    *event->mutable_bundle() = bundle_->facts;
  } else if (requested_ < bundle_->request.size()) {
    event->set_request(next_piece(bundle_->request, requested_, most));
  } else if (answered_ < bundle_->answer.size()) {
    event->set_answer(next_piece(bundle_->answer, answered_, most));
  } else {
    return false;
  }
  return true;
}

std::optional<grpc::Status> BundleCall::ending() {
  if (broken()) return to_status(failure(ErrorCode::cancelled, "the client gave up"));
  if (fault_) return end_of_stream(parts_, *fault_);
  if (bundle_ != nullptr) return grpc::Status::OK;
  if (parts_.scheduler.is_drained()) return end_of_stream(parts_, draining());
  return std::nullopt;
}

}  // namespace marble::server
