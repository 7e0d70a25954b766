#include "submissions/arrays.h"

#include <algorithm>
#include <utility>

#include "base/random_id.h"
#include "base/status.h"
#include "jobs/unix_time.h"
#include "service/job_message.h"
#include "service/stored_job.h"
#include "store/submissions.h"
#include "submissions/memory_elements.h"

namespace marble::server {
namespace {

constexpr std::int64_t kMostElements = 10'000'000;  // the maximum of the setting array_elements

Error unreadable() { return failure(ErrorCode::internal, "the stored array cannot be read"); }

}  // namespace

std::shared_ptr<Arrays> Arrays::make(const ServiceParts& parts, JobStore* store) {
  const std::shared_ptr<Arrays> arrays(new Arrays(parts, store));
  parts.results.report_forgotten([weak = std::weak_ptr<Arrays>(arrays)](const std::string& id) {
    if (const auto strong = weak.lock()) strong->forgotten(id);
  });
  return arrays;
}

Arrays::Arrays(const ServiceParts& parts, JobStore* store)
    : parts_(parts),
      on_disk_(store),
      in_memory_(store == nullptr ? std::make_unique<MemoryElements>() : nullptr),
      elements_(store == nullptr ? *in_memory_ : *static_cast<ArrayStore*>(store)) {}

Expected<std::shared_ptr<ArrayDraft>> Arrays::begin(const Caller& caller, v1::ArraySetup setup) {
  if (auto well = parts_.submissions->health(); !well) return unexpected(Submissions::not_kept(well.error()));
  const std::string bytes = setup.SerializeAsString();
  const std::string request_id = setup.request_id();
  MARBLE_ASSIGN_OR_RETURN(auto checked, ArraySetup::check(parts_, caller, std::move(setup)));
  std::shared_ptr<Scheduler::Place> place;
  const std::string& client = caller.identity.client;
  if (request_id.empty() || parts_.results.named(client, request_id).empty()) {
    const JobDescription& what = checked->record()->description();
    MARBLE_ASSIGN_OR_RETURN(
        place, parts_.scheduler.open_place(client, what.priority, parts_.access.quota_of(client), false));
    MARBLE_RETURN_IF_ERROR(place->add_bytes(static_cast<std::int64_t>(bytes.size())));
  } else if (parts_.scheduler.is_closed()) {
    return unexpected(draining());
  }
  return LocalArrayDraft::make(*this, caller, std::move(checked), std::move(place), bytes);
}

std::shared_ptr<Array> Arrays::find(const std::string& id) const {
  const MutexLock lock(mutex_);
  const auto found = arrays_.find(id);
  return found == arrays_.end() ? nullptr : found->second;
}

void Arrays::forgotten(const std::string& id) {
  std::shared_ptr<Array> array;
  {
    const MutexLock lock(mutex_);
    const auto found = arrays_.find(id);
    if (found == arrays_.end()) return;
    array = std::move(found->second);
    arrays_.erase(found);
  }
  if (in_memory_ != nullptr) in_memory_->forget(id);
  array->forgotten();
}

void Arrays::run(ArrayStart start) {
  const auto record = start.record;
  const bool is_over = start.is_over;
  const auto array = std::make_shared<Array>(parts_, elements_, one_suspect_, std::move(start));
  parts_.board.add(record);
  {
    const MutexLock lock(mutex_);
    arrays_[record->id()] = array;
  }
  if (!is_over) array->start();
}

// Rows may be missing or contain anything: each element is either open or has a result.
Expected<bool> Arrays::read_elements(const std::string& id, std::int64_t elements, ArrayStart& start) {
  start.counts.elements = elements;
  std::vector<OpenElement> all(static_cast<std::size_t>(elements));
  std::vector<bool> answered(all.size());
  for (std::int64_t index = 0; index < elements; ++index) all[static_cast<std::size_t>(index)].index = index;
  std::int64_t request_bytes = 0, rows = 0;
  bool is_sound = true;
  auto read = on_disk_->each_element(id, [&](const ElementRow& row) {
    if (row.index < 0 || row.index >= elements) return;
    ++rows;
    is_sound = is_sound && row.sequence <= elements;
    const auto at = static_cast<std::size_t>(row.index);
    all[at].lost = std::clamp<std::int64_t>(row.lost, 0, 1'000'000);
    request_bytes += row.request_bytes;
    if (row.sequence <= 0) return;
    answered[at] = true;
    ++start.counts.done;
    if (row.end == ElementEnd::solved) ++start.counts.solved;
    if (row.end == ElementEnd::failed) ++start.counts.failed;
    start.counts.iterations += row.iterations;
    start.counts.factorizations += row.factorizations;
    start.answer_bytes += row.answer_bytes;
    start.last_sequence = std::max(start.last_sequence, row.sequence);
  });
  if (!read) return unexpected(read.error());
  if (!is_sound || rows < elements / 2) return false;
  for (std::size_t at = 0; at < all.size(); ++at) {
    if (!answered[at]) start.open.push_back(all[at]);
  }
  if (start.place == nullptr) return true;
  auto counted = start.place->add_bytes(request_bytes);
  return counted ? Expected<bool>(true) : unexpected(counted.error());
}

// It ends with this error. Unreadable parts are not shown.
void Arrays::take_up_broken(const StoredJob& stored, const Error& error) {
  JobDescription what = description_of(stored, {});
  what.kind = JobKind::array;
  ArrayStart start{.record = parts_.board.make(std::move(what), Options()), .open = {{0, 0}}, .end = error};
  run(std::move(start));
}

Expected<void> Arrays::take_up(const StoredJob& stored) {
  const std::int64_t elements = *stored.elements;
  if (elements < 1 || elements > kMostElements) {
    take_up_broken(stored, unreadable());
    return {};
  }
  const auto bytes = on_disk_->request_of(stored.id);
  v1::ArraySetup message;
  if (!bytes || !message.ParseFromString(*bytes)) {
    take_up_broken(stored, unreadable());
    return {};
  }
  const Quota quota = parts_.access.quota_of(stored.client);
  const auto highest = static_cast<std::int64_t>(quota.priority);
  message.set_priority(to_message(priority_of(std::max(stored.priority, highest))));
  const Caller caller{.identity = {.client = stored.client, .roles = {}},
                      .origin = {.peer = stored.peer,
                                 .client = stored.client,
                                 .request_id = stored.request_id,
                                 .trace = parse_traceparent(stored.traceparent, random_id())},
                      .earlier = Caller::Earlier{stored.id, time_of(stored.accepted_unix_s)}};
  auto setup = ArraySetup::check(parts_, caller, std::move(message));
  if (!setup) {
    take_up_broken(stored, setup.error());
    return {};
  }
  ArrayStart start{.record = (*setup)->record(), .setup = *setup};
  MARBLE_ASSIGN_OR_RETURN(start.place, parts_.scheduler.open_place(
                                           stored.client, start.record->description().priority, quota, true));
  MARBLE_RETURN_IF_ERROR(start.place->add_bytes(static_cast<std::int64_t>(bytes->size())));
  MARBLE_ASSIGN_OR_RETURN(const auto whole, read_elements(stored.id, elements, start));
  if (!whole) {
    take_up_broken(stored, unreadable());
    return {};
  }
  if (stored.cancelled)
    start.end = failure(ErrorCode::cancelled, "given up before the server was started again");
  (void)parts_.results.grow(stored.id, start.answer_bytes);
  run(std::move(start));
  return {};
}

Expected<void> Arrays::take_up_answered(const StoredResult& stored,
                                        const std::shared_ptr<JobRecord>& record) {
  ArrayStart start{.record = record, .is_over = true};
  const std::int64_t elements = stored.elements.value_or(0);
  if (elements < 0 || elements > kMostElements) return {};
  MARBLE_RETURN_IF_ERROR(read_elements(stored.id, elements, start));
  google::rpc::Status error;
  if (!stored.error.empty()) start.end = error.ParseFromString(stored.error) ? error_of(error) : unreadable();
  const auto age = std::max<std::chrono::system_clock::duration>(
      std::chrono::system_clock::now() - time_of(stored.finished_unix_s), {});
  const std::int64_t answer_bytes = start.answer_bytes;
  run(std::move(start));
  parts_.board.finish(record);
  parts_.results.put(stored.id, no_single_answer(stored.id),
                     Clock::now() - std::chrono::duration_cast<Clock::duration>(age), answer_bytes);
  return {};
}

}  // namespace marble::server
