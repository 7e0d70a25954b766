#include "submissions/array_draft.h"

#include <utility>

#include "jobs/unix_time.h"
#include "store/digest.h"
#include "store/submissions.h"

namespace marble::server {
namespace {

constexpr std::int64_t kElementBytes = 64;    // memory of an element besides its message
constexpr std::int64_t kMostUnsettled = 256;  // elements on their way to the store
constexpr std::int64_t kMostUnsettledBytes = 8 << 20;

}  // namespace

ArrayDraft::ArrayDraft(const ServiceParts& parts, const Caller& caller,
                       std::shared_ptr<const ArraySetup> setup, const std::string& setup_bytes,
                       std::int64_t most_elements)
    : parts_(parts),
      caller_(caller),
      setup_(std::move(setup)),
      id_(setup_->record()->id()),
      request_id_(setup_->record()->description().request_id),
      most_elements_(most_elements),
      digest_(request_id_.empty() ? "" : digest_of(setup_bytes)) {}

StoredJob ArrayDraft::stored(const std::string& setup_bytes) const {
  const JobDescription& what = setup_->record()->description();
  return {.id = id_,
          .client = what.client,
          .request_id = request_id_,
          .peer = what.peer,
          .traceparent = what.trace ? to_traceparent(*what.trace) : "",
          .priority = static_cast<std::int64_t>(what.priority),
          .accepted_unix_s = unix_s(what.accepted),
          .request = setup_bytes};
}

v1::SubmitArrayResponse ArrayDraft::reported(const std::string& id) const {
  v1::SubmitArrayResponse response;
  response.set_job_id(id);
  response.set_elements(elements_);
  return response;
}

void ArrayDraft::fail(const Error& why) {
  const MutexLock lock(mutex_);
  if (!failed_) failed_ = why;
}

std::optional<Error> ArrayDraft::failed() const {
  const MutexLock lock(mutex_);
  return failed_;
}

bool ArrayDraft::is_full() const {
  const MutexLock lock(mutex_);
  return unsettled_ >= kMostUnsettled || unsettled_bytes_ >= kMostUnsettledBytes;
}

Expected<void> ArrayDraft::add(v1::ArrayElement element, const std::function<void()>& settled) {
  const std::int64_t index = elements_++;
  if (index >= most_elements_) {
    return unexpected(failure(ErrorCode::resource_exhausted, "array_elements", std::to_string(elements_),
                              "an array may have at most " + std::to_string(most_elements_)));
  }
  StoredElement stored{.array = id_, .index = index, .request = element.SerializeAsString()};
  if (!request_id_.empty()) digest_ = digest_of(digest_ + digest_of(stored.request));
  if (is_repeated()) return {};
  if (const auto why = failed()) return unexpected(*why);
  const auto request = setup_->request(std::move(element));
  if (!request) return unexpected(of_element(index, request.error()));
  if (const auto job = make_job(parts_, caller_, JobKind::array, *request); !job)
    return unexpected(of_element(index, inside("solve", job.error())));
  const auto bytes = static_cast<std::int64_t>(stored.request.size());
  MARBLE_RETURN_IF_ERROR(add_bytes(bytes + kElementBytes));
  {
    const MutexLock lock(mutex_);
    ++unsettled_;
    unsettled_bytes_ += bytes;
  }
  keep(std::move(stored), [self = shared_from_this(), bytes, settled](const Expected<void>& made) {
    if (!made) self->fail(Submissions::not_kept(made.error()));
    {
      const MutexLock lock(self->mutex_);
      --self->unsettled_;
      self->unsettled_bytes_ -= bytes;
    }
    settled();
  });
  return {};
}

void ArrayDraft::seal(std::int64_t elements, const Sealed& sealed) {
  if (elements == elements_ && elements > 0) return seal_all(sealed);
  sealed(unexpected(invalid(
      "end.elements", std::to_string(elements),
      elements_ == 0 ? "must be at least one" : "must be as many as came: " + std::to_string(elements_))));
}

}  // namespace marble::server
