#include "message/session_request.h"

#include <algorithm>

#include "marble/convert.h"
#include "message/request.h"
#include "message_text.h"

namespace marble::client {
namespace {

constexpr double kPassed = 1e-9;  // to the server 0 means no deadline at all

using Blocks = google::protobuf::RepeatedPtrField<v1::ShiftBlock>;

void fill(const std::vector<ShiftBlock>& blocks, Blocks* message) {
  for (const ShiftBlock& block : blocks) {
    v1::ShiftBlock* added = message->Add();
    added->set_first(block.first);
    added->set_count(block.count);
    added->set_by(block.by);
  }
}

void fill(const Shift& shift, v1::Shift* message) {
  fill(shift.variables, message->mutable_variables());
  fill(shift.equalities, message->mutable_equalities());
  fill(shift.inequalities, message->mutable_inequalities());
  fill(shift.pairs, message->mutable_pairs());
}

}  // namespace

Expected<v1::SessionRequest> make_setup(const ProblemView& problem, const Options& options,
                                        const SessionOptions& session) {
  if (auto valid = check_request_id(session.request_id); !valid) return unexpected(valid.error());
  v1::SessionRequest request;
  v1::SessionSetup* setup = request.mutable_setup();
  marble::to_message(problem, setup->mutable_problem());
  setup->mutable_problem()->set_name(message_text(session.problem_name, contract::longest_problem_name));
  marble::to_message(options, setup->mutable_options());
  setup->mutable_initial_point()->mutable_z()->Assign(session.initial_z.begin(), session.initial_z.end());
  setup->set_request_id(session.request_id);
  setup->set_priority(to_message(session.priority));
  setup->set_latest_only(session.latest_only);
  setup->set_progress(session.progress);
  setup->set_progress_interval_s(session.progress_interval_s);
  setup->set_iterate_every(session.iterate_every);
  if (auto fits = check_size(request); !fits) return unexpected(fits.error());
  return request;
}

Expected<v1::SessionRequest> make_update(std::int64_t epoch, std::int64_t sequence,
                                         const ProblemUpdate& update, const UpdateControls& controls,
                                         bool first_part) {
  v1::SessionRequest request;
  v1::SessionUpdate* message = request.mutable_update();
  message->set_epoch(epoch);
  message->set_sequence(sequence);
  marble::to_message(update, message->mutable_problem());
  if (controls.options) marble::to_message(*controls.options, message->mutable_options());
  if (!controls.initial_z.empty())
    message->mutable_initial_point()->mutable_z()->Assign(controls.initial_z.begin(),
                                                          controls.initial_z.end());
  message->set_cold(controls.cold);
  message->set_prepare(first_part);
  fill(controls.shift, message->mutable_shift());
  if (controls.sensitivity != nullptr)
    marble::to_message(*controls.sensitivity, message->mutable_sensitivity());
  if (controls.deadline) message->set_deadline_s(std::max(controls.deadline->count(), kPassed));
  if (auto fits = check_size(request); !fits) return unexpected(fits.error());
  return request;
}

}  // namespace marble::client
