#include "submissions/array_draft.h"

#include <utility>

#include "base/random_id.h"
#include "jobs/unix_time.h"
#include "store/digest.h"
#include "store/submissions.h"
#include "submissions/arrays.h"

namespace marble::server {
namespace {

constexpr std::int64_t kElementBytes = 64;    // memory of an element besides its message
constexpr std::int64_t kMostUnsettled = 256;  // elements on their way to the store
constexpr std::int64_t kMostUnsettledBytes = 8 << 20;

v1::SubmitArrayResponse reported(const std::string& id, std::int64_t elements) {
  v1::SubmitArrayResponse response;
  response.set_job_id(id);
  response.set_elements(elements);
  return response;
}

}  // namespace

ArrayDraft::ArrayDraft(Arrays& arrays, const Caller& caller, std::shared_ptr<const ArraySetup> setup,
                       std::shared_ptr<Scheduler::Place> place, const std::string& setup_bytes)
    : arrays_(arrays),
      caller_(caller),
      setup_(std::move(setup)),
      place_(std::move(place)),
      is_repeated_(place_ == nullptr),
      id_(setup_->record()->id()),
      request_id_(setup_->record()->description().request_id),
      digest_(request_id_.empty() ? "" : digest_of(setup_bytes)) {}

// A failed write is reported at the end; until then other writes may succeed.
void ArrayDraft::open(const std::string& setup_bytes) {
  if (is_repeated_) return;
  const JobDescription& what = setup_->record()->description();
  StoredJob stored{.id = id_,
                   .client = what.client,
                   .request_id = request_id_,
                   .peer = what.peer,
                   .traceparent = what.trace ? to_traceparent(*what.trace) : "",
                   .priority = static_cast<std::int64_t>(what.priority),
                   .accepted_unix_s = unix_s(what.accepted),
                   .request = setup_bytes};
  arrays_.elements_.open_array(std::move(stored), [self = shared_from_this()](const Expected<void>& made) {
    const MutexLock lock(self->mutex_);
    if (!made) self->failed_ = made.error();
  });
}

ArrayDraft::~ArrayDraft() {
  if (!is_repeated_ && !is_sealed_) arrays_.elements_.forget(id_);
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
  const ServiceParts& parts = arrays_.parts_;
  const std::int64_t index = elements_++;
  const std::int64_t most = parts.config.array_elements;
  if (index >= most) {
    return unexpected(failure(ErrorCode::resource_exhausted, "array_elements", std::to_string(elements_),
                              "an array may have at most " + std::to_string(most)));
  }
  StoredElement stored{.array = id_, .index = index, .request = element.SerializeAsString()};
  if (!request_id_.empty()) digest_ = digest_of(digest_ + digest_of(stored.request));
  if (is_repeated_) return {};
  if (const auto why = failed()) return unexpected(Submissions::not_kept(*why));
  const auto request = setup_->request(std::move(element));
  if (!request) return unexpected(of_element(index, request.error()));
  if (const auto job = make_job(parts, caller_, JobKind::array, *request); !job)
    return unexpected(of_element(index, inside("solve", job.error())));
  const auto bytes = static_cast<std::int64_t>(stored.request.size());
  if (auto fits = place_->add_bytes(bytes + kElementBytes); !fits) return fits;
  {
    const MutexLock lock(mutex_);
    ++unsettled_;
    unsettled_bytes_ += bytes;
  }
  arrays_.elements_.add_element(std::move(stored),
                                [self = shared_from_this(), bytes, settled](const Expected<void>& made) {
                                  {
                                    const MutexLock lock(self->mutex_);
                                    --self->unsettled_;
                                    self->unsettled_bytes_ -= bytes;
                                    if (!made && !self->failed_) self->failed_ = made.error();
                                  }
                                  settled();
                                });
  return {};
}

void ArrayDraft::seal(std::int64_t elements, const Sealed& sealed) {
  if (elements != elements_ || elements == 0) {
    return sealed(unexpected(invalid(
        "end.elements", std::to_string(elements),
        elements_ == 0 ? "must be at least one" : "must be as many as came: " + std::to_string(elements_))));
  }
  const auto id = arrays_.parts_.results.expect(id_, caller_.identity.client, {request_id_, digest_});
  if (!id) return sealed(unexpected(id.error()));
  if (*id != id_) {
    return arrays_.elements_.when_settled([sealed, response = reported(*id, elements_)](
                                              const Expected<void>& /*written*/) { sealed(response); });
  }
  if (!is_repeated_) return seal_new(sealed);
  // The other array was dropped meanwhile, and this one was not kept.
  arrays_.parts_.results.forget(id_);
  sealed(unexpected(
      failure(ErrorCode::unavailable, "the array of this request_id was let go just now: send it again")));
}

// A client that gets the id finds the array.
void ArrayDraft::seal_new(const Sealed& sealed) {
  arrays_.elements_.seal_array(
      id_, elements_, digest_, [self = shared_from_this(), sealed](const Expected<void>& made) {
        const auto why = self->failed();
        if (!made || why) {
          self->arrays_.parts_.results.forget(self->id_);
          return sealed(unexpected(Submissions::not_kept(why ? *why : made.error())));
        }
        self->is_sealed_ = true;
        ArrayStart start{.record = self->setup_->record(),
                         .setup = self->setup_,
                         .place = std::exchange(self->place_, nullptr),
                         .counts = {.elements = self->elements_}};
        for (std::int64_t index = 0; index < self->elements_; ++index) start.open.push_back({index, 0});
        self->arrays_.run(std::move(start));
        sealed(reported(self->id_, self->elements_));
      });
}

}  // namespace marble::server
