#include "message/session_request.h"

#include <algorithm>

#include "marble/convert.h"
#include "marble/restart.h"
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
  MARBLE_RETURN_IF_ERROR(check_request_id(session.request_id));
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
  MARBLE_RETURN_IF_ERROR(check_size(request));
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
  MARBLE_RETURN_IF_ERROR(check_size(request));
  return request;
}

namespace {

using Numbers = google::protobuf::RepeatedField<double>;

void take_numbers(std::span<const double> from, Numbers* to) {
  if (!from.empty()) to->Assign(from.begin(), from.end());
}

// An update of a full Q uses only the upper triangle; a set-up needs both triangles equal.
void mirror(v1::SparseMatrix* matrix) {
  const auto& columns = matrix->column_pointers();
  const auto& rows = matrix->row_indices();
  if (matrix->values_size() != rows.size()) return;  // an update that the server rejects
  for (int column = 0; column < matrix->columns(); ++column) {
    for (int entry = columns[column]; entry < columns[column + 1]; ++entry) {
      const int row = rows[entry];
      if (row <= column) continue;
      const auto begin = rows.begin() + columns[row];
      const auto found = std::lower_bound(begin, rows.begin() + columns[row + 1], column);
      matrix->set_values(entry, matrix->values(static_cast<int>(found - rows.begin())));
    }
  }
}

}  // namespace

void SessionMemory::take(const ProblemUpdate& update, const UpdateControls& controls) {
  v1::SessionSetup& setup = *setup_.mutable_setup();
  v1::Problem& problem = *setup.mutable_problem();
  if (update.c0) problem.set_constant(*update.c0);
#define MARBLE_VECTOR(letter, field) take_numbers(update.letter, problem.mutable_##field());
#define MARBLE_MATRIX(letter, field, of_update, vector) \
  take_numbers(update.letter, problem.mutable_##field()->mutable_values());
#include "marble/contract.def"
  if (!update.Q.empty() && problem.hessian_form() == v1::HESSIAN_FORM_FULL) mirror(problem.mutable_hessian());
  if (controls.options) {
    const std::int32_t passes = setup.options().scaling_passes();
    marble::to_message(*controls.options, setup.mutable_options());
    setup.mutable_options()->set_scaling_passes(passes);
  }
  take_numbers(controls.initial_z, setup.mutable_initial_point()->mutable_z());
}

void SessionMemory::take_first_part(const ProblemUpdate& update, const UpdateControls& controls) {
  take(update, controls);
  if (controls.cold || last_z_.empty()) return last_z_.clear();
  if (controls.initial_z.empty()) {
    shift(controls.shift.variables, last_z_);
  } else {
    last_z_.assign(controls.initial_z.begin(), controls.initial_z.end());
  }
}

void SessionMemory::take(const std::vector<double>& z) { last_z_ = z; }

v1::SessionRequest SessionMemory::setup(const UpdateControls& next) const {
  v1::SessionRequest request = setup_;
  if (next.cold || last_z_.empty()) return request;
  std::vector<double> z = last_z_;
  for (const ShiftBlock& block : next.shift.variables) {
    const std::int64_t end = std::int64_t{block.first} + block.count;
    if (block.first < 0 || block.by < 0 || block.by > block.count || end > std::int64_t(z.size())) continue;
    shift({&block, 1}, z);
  }
  take_numbers(z, request.mutable_setup()->mutable_initial_point()->mutable_z());
  return request;
}

}  // namespace marble::client
