#include "fleet/fleet_arrays.h"

#include <algorithm>
#include <utility>

#include "base/random_id.h"
#include "jobs/unix_time.h"
#include "service/admission.h"
#include "service/job_message.h"

namespace marble::server {
namespace {

Error unreadable_array() { return failure(ErrorCode::internal, "the stored array cannot be read"); }

// Rows may be missing or contain anything. If most of them are missing, or have numbers that were never
// assigned, they are of another array.
bool is_sound(const TakenJob& taken) {
  const std::int64_t elements = *taken.stored.elements;
  return elements <= kMostFleetElements && taken.elements.rows >= elements / 2 &&
         taken.elements.last_sequence <= elements;
}

}  // namespace

Expected<std::string> FleetElements::element(const std::string& /*array*/, std::int64_t index) {
  const MutexLock lock(mutex_);
  auto found = requests_.extract(index);
  if (!found.empty()) return std::move(found.mapped());
  return unexpected(failure(ErrorCode::not_found, "element", std::to_string(index), "is not in the store"));
}

void FleetElements::answer_element(ElementAnswer answer, CompletionCallback settled) {
  if (static_cast<std::int64_t>(answer.message.size()) > kLargestValue)
    return settled(
        unexpected(failure(ErrorCode::resource_exhausted, "result_bytes",
                           std::to_string(answer.message.size()), "is larger than the store takes, 1 GB")));
  {
    const MutexLock lock(mutex_);
    requests_.erase(answer.index);
    if (const auto size = sizes_.extract(answer.index); !size.empty()) request_bytes_ -= size.mapped();
  }
  store_.answer_element(std::move(answer), token_, std::move(settled));
}

void FleetElements::claim(bool suspect, std::int64_t most, Claimed then) {
  const auto claim = std::make_shared<ElementClaim>();
  claim->id = id_;
  claim->token = token_;
  claim->suspect = suspect;
  claim->most = most;
  {
    const MutexLock lock(mutex_);
    claim->number = ++claims_;
  }
  store_.claim_elements(claim, [this, claim, then = std::move(then)](const Expected<void>& made) {
    if (!made) return then(unexpected(made.error()));
    claimed(*claim, then);
  });
}

void FleetElements::claimed(const ElementClaim& claim, const Claimed& then) {
  if (!claim.is_held) return then(unexpected(failure(ErrorCode::cancelled, "another server has the array")));
  {
    const MutexLock lock(mutex_);
    for (const ClaimedElement& element : claim.elements) {
      if (!element.request) continue;
      sizes_[element.index] = static_cast<std::int64_t>(element.request->size());
      requests_[element.index] = *element.request;
    }
  }
  then(claim.elements);
}

std::int64_t FleetElements::request_bytes() const {
  const MutexLock lock(mutex_);
  return request_bytes_;
}

Expected<FleetArray> make_fleet_array(const ServiceParts& parts, FleetStore& store, OneSuspect& one_suspect,
                                      const TakenJob& taken, const std::shared_ptr<JobRecord>& record,
                                      std::function<void()> left) {
  const StoredJob& stored = taken.stored;
  v1::ArraySetup message;
  if (!is_sound(taken) || !message.ParseFromString(stored.request)) return unexpected(unreadable_array());
  const Quota quota = parts.access.quota_of(stored.client);
  const auto highest = static_cast<std::int64_t>(quota.priority);
  message.set_priority(to_message(priority_of(std::max(stored.priority, highest))));
  const Caller caller{
      .identity = {.client = stored.client, .roles = {}},
      .origin = {.peer = stored.peer, .client = stored.client, .request_id = stored.request_id},
      .earlier = Caller::Earlier{stored.id, time_of(stored.accepted_unix_s), record}};
  MARBLE_ASSIGN_OR_RETURN(auto setup, ArraySetup::check(parts, caller, std::move(message)));
  MARBLE_ASSIGN_OR_RETURN(
      auto place, parts.scheduler.open_place(stored.client, priority_of(stored.priority), quota, true));
  const auto setup_bytes = static_cast<std::int64_t>(stored.request.size());
  (void)place->add_bytes(setup_bytes);
  FleetArray made;
  made.elements = std::make_shared<FleetElements>(store, stored.id, taken.token,
                                                  setup_bytes + taken.elements.request_bytes);
  ArrayStart start{.record = record,
                   .setup = setup,
                   .place = std::move(place),
                   .counts = taken.elements.counts,
                   .last_sequence = taken.elements.last_sequence,
                   .answer_bytes = taken.elements.answer_bytes,
                   .store = made.elements,
                   .left = std::move(left)};
  (void)parts.results.grow(stored.id, start.answer_bytes);
  made.array = std::make_shared<Array>(parts, *made.elements, one_suspect, std::move(start));
  return made;
}

}  // namespace marble::server
