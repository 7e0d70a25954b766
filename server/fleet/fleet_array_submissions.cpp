// FleetSubmissions: arrays.
#include "base/fault_point.h"
#include "fleet/fleet_draft.h"
#include "fleet/fleet_submissions.h"

namespace marble::server {

Expected<std::shared_ptr<ArrayDraft>> FleetSubmissions::begin_array(const Caller& caller,
                                                                    v1::ArraySetup setup) {
  return FleetDraft::make(parts_, store_, caller, std::move(setup));
}

bool FleetSubmissions::is_array(const std::string& id) const {
  const auto record = parts_.board.find(id);
  return record != nullptr && record->description().kind == JobKind::array;
}

void FleetSubmissions::take_in_array(const TakenJob& taken, const std::shared_ptr<JobRecord>& record) {
  const StoredJob& stored = taken.stored;
  const auto end_it = [&](const Error& error) { end(record, taken.token, taken.age_s, error); };
  record->set_array(taken.elements.counts, taken.elements.answer_bytes);
  fault_point("take", stored.request_id);
  if (stored.cancelled)
    return end_it(failure(ErrorCode::cancelled, "given up before all its elements had an answer"));
  auto made = make_fleet_array(parts_, store_, one_suspect_, taken, record,
                               [this, id = stored.id, token = taken.token] { left(id, token); });
  if (!made && parts_.scheduler.is_closed()) return left(stored.id, taken.token);
  if (!made) return end_it(made.error());
  const std::shared_ptr<Array> array = made->array;
  {
    const MutexLock lock(mutex_);
    held_[stored.id].elements = std::move(*made);
  }
  array->start();
}

// The array has ended, or this server drains, or another one has the array.
void FleetSubmissions::left(const std::string& id, const std::string& token) {
  bool is_lost = false, is_over = false;
  {
    const MutexLock lock(mutex_);
    const auto job = held_.find(id);
    if (job == held_.end() || job->second.token != token) return;
    is_lost = job->second.is_lost;
    is_over = job->second.record->is_finished();
  }
  parts_.results.stop_growing(id);
  if (!is_lost && !is_over) store_.release(id, token);
  erase(id, token);
  if (is_lost) {
    parts_.board.forget(id);
    mirror_.read_anew(id);
  } else if (is_over) {
    look("", [](const Expected<void>& /*looked*/) {});
  }
}

}  // namespace marble::server
