#include "session_update.h"

#include <utility>

#include "marble/convert.h"

namespace marble::server {
namespace {

using Blocks = google::protobuf::RepeatedPtrField<v1::ShiftBlock>;

template <class Field>
void take_field(Field* older, Field* newer) {
  if (newer->empty()) newer->Swap(older);
}

void prepend(const Blocks& older, Blocks* newer) {
  Blocks both = older;
  both.MergeFrom(*newer);
  newer->Swap(&both);
}

std::vector<ShiftBlock> blocks_of(const Blocks& messages) {
  std::vector<ShiftBlock> blocks;
  blocks.reserve(static_cast<std::size_t>(messages.size()));
  for (const v1::ShiftBlock& block : messages) blocks.push_back({block.first(), block.count(), block.by()});
  return blocks;
}

// Paths of an update's own fields, where a part's differs from that of a whole problem.
std::string update_field(const std::string& core_field) {
  std::string field = message_field(core_field);
  const std::string matrix = "_matrix.values";
  if (const auto at = field.find(matrix); at != std::string::npos)
    field.replace(at, matrix.size(), "_values");
  if (field == "hessian.values") field = "hessian_values";
  return "problem." + field;
}

}  // namespace

void take_along(v1::SessionUpdate older, v1::SessionUpdate& newer) {
  v1::ProblemUpdate& from = *older.mutable_problem();
  v1::ProblemUpdate& to = *newer.mutable_problem();
  if (from.has_constant() && !to.has_constant()) to.set_constant(from.constant());
  take_field(from.mutable_gradient(), to.mutable_gradient());
  take_field(from.mutable_equality_offset(), to.mutable_equality_offset());
  take_field(from.mutable_inequality_offset(), to.mutable_inequality_offset());
  take_field(from.mutable_left_offset(), to.mutable_left_offset());
  take_field(from.mutable_right_offset(), to.mutable_right_offset());
  take_field(from.mutable_hessian_values(), to.mutable_hessian_values());
  take_field(from.mutable_equality_values(), to.mutable_equality_values());
  take_field(from.mutable_inequality_values(), to.mutable_inequality_values());
  take_field(from.mutable_left_values(), to.mutable_left_values());
  take_field(from.mutable_right_values(), to.mutable_right_values());
  if (older.has_initial_point() && !newer.has_initial_point())
    newer.mutable_initial_point()->Swap(older.mutable_initial_point());
  newer.set_cold(older.cold() || newer.cold());
  if (!older.has_shift()) return;
  prepend(older.shift().variables(), newer.mutable_shift()->mutable_variables());
  prepend(older.shift().equalities(), newer.mutable_shift()->mutable_equalities());
  prepend(older.shift().inequalities(), newer.mutable_shift()->mutable_inequalities());
  prepend(older.shift().pairs(), newer.mutable_shift()->mutable_pairs());
}

Restart restart_of(const v1::SessionUpdate& update) {
  const auto& z = update.initial_point().z();
  const v1::Shift& shift = update.shift();
  return {{z.data(), static_cast<std::size_t>(z.size())},
          update.cold(),
          {blocks_of(shift.variables()), blocks_of(shift.equalities()), blocks_of(shift.inequalities()),
           blocks_of(shift.pairs())}};
}

Expected<void> check_update(const v1::SessionUpdate& update, const PartSizes& sizes) {
  if (auto valid = sizes.check(update_of(update.problem())); !valid) {
    Error error = valid.error();
    error.field = update_field(error.field);
    return unexpected(std::move(error));
  }
  if (auto valid = restart_of(update).check(sizes); !valid) {
    Error error = valid.error();
    if (error.field == "initial_z") error.field = "initial_point.z";
    return unexpected(std::move(error));
  }
  if (update.deadline_s() >= 0.0) return {};
  return unexpected(Error{ErrorCode::invalid_argument, "deadline_s", -1, std::to_string(update.deadline_s()),
                          "must be >= 0"});
}

}  // namespace marble::server
