#include "fleet/fleet_draft.h"

#include <algorithm>
#include <utility>

#include "base/random_id.h"
#include "base/status.h"
#include "fleet/fleet_arrays.h"
#include "marble/convert.h"
#include "service/job_message.h"
#include "store/submissions.h"

namespace marble::server {
namespace {

std::string info_of(const JobRecord& record) {
  v1::JobInfo info;
  to_message(record, &info);
  return info.SerializeAsString();
}

Error too_large(std::size_t bytes) {
  return failure(ErrorCode::resource_exhausted, "problem", std::to_string(bytes),
                 "is larger than the store takes, 1 GB");
}

}  // namespace

// A name in a certificate may contain any bytes, which the store would refuse at each retry.
Expected<void> check_name(const std::string& client) {
  if (client.find('\0') == std::string::npos && utf8(client) == client) return {};
  return unexpected(
      invalid("client", "must be named in UTF-8, without a zero byte, where others share its jobs"));
}

FleetDraft::FleetDraft(const ServiceParts& parts, FleetStore& store, const Caller& caller,
                       std::shared_ptr<const ArraySetup> setup, const std::string& setup_bytes)
    : ArrayDraft(parts, caller, std::move(setup), setup_bytes,
                 std::min<std::int64_t>(parts.config.array_elements, kMostFleetElements)),
      store_(store),
      job_(std::make_shared<FleetJob>()) {
  job_->stored = stored(setup_bytes);
  job_->stored.elements = 0;
  job_->quota = parts.access.quota_of(caller.identity.client);
  job_->info = info_of(*this->setup().record());
  job_->token = random_id();
}

Expected<std::shared_ptr<ArrayDraft>> FleetDraft::make(const ServiceParts& parts, FleetStore& store,
                                                       const Caller& caller, v1::ArraySetup setup) {
  if (parts.scheduler.is_closed()) return unexpected(draining());
  if (auto well = store.health(); !well) return unexpected(Submissions::not_kept(well.error()));
  MARBLE_RETURN_IF_ERROR(check_name(caller.identity.client));
  const std::string bytes = setup.SerializeAsString();
  if (bytes.size() > kLargestValue) return unexpected(too_large(bytes.size()));
  MARBLE_ASSIGN_OR_RETURN(auto checked, ArraySetup::check(parts, caller, std::move(setup)));
  const std::shared_ptr<FleetDraft> draft(new FleetDraft(parts, store, caller, std::move(checked), bytes));
  draft->open();
  return draft;
}

void FleetDraft::open() {
  store_.open_array(job_, [self = self()](const Expected<void>& made) {
    if (!made) return self->fail(Submissions::not_kept(made.error()));
    self->look_at_refusal();
    self->is_repeated_ = self->job_->id && *self->job_->id != self->id();
  });
}

void FleetDraft::look_at_refusal() {
  if (!job_->id) fail(job_->id.error());
}

FleetDraft::~FleetDraft() {
  if (!is_sealed_ && !is_repeated_) store_.drop_array(job_);
}

void FleetDraft::keep(StoredElement element, CompletionCallback settled) {
  if (element.request.size() > kLargestValue) fail(too_large(element.request.size()));
  if (const auto why = failed()) return settled({});
  store_.add_element(job_, std::move(element),
                     [self = self(), settled = std::move(settled)](const Expected<void>& made) {
                       if (made) self->look_at_refusal();
                       settled(made);
                     });
}

void FleetDraft::seal_all(const Sealed& sealed) {
  setup().record()->set_array({.elements = elements()}, 0);
  StoredResult whole{.digest = digest(), .info = info_of(*setup().record()), .elements = elements()};
  store_.seal_array(job_, std::move(whole), [self = self(), sealed](const Expected<void>& made) {
    if (!made) return sealed(unexpected(Submissions::not_kept(made.error())));
    const Expected<std::string>& id = self->job_->id;
    if (const auto why = self->failed(); why && !id) return sealed(unexpected(*why));
    if (!id) return sealed(unexpected(id.error()));
    self->is_sealed_ = *id == self->id();
    sealed(self->reported(*id));
  });
}

}  // namespace marble::server
