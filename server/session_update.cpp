#include "session_update.h"

#include <utility>

#include "marble/convert.h"
#include "wire.h"

namespace marble::server {
namespace {

constexpr std::int64_t kRest = 4096;     // bytes of options and all else that is no array
constexpr std::size_t kBlockBytes = 20;  // at most, of a message
constexpr std::size_t kBlockFields = 4;  // with itself

using Blocks = google::protobuf::RepeatedPtrField<v1::ShiftBlock>;

template <class Field>
void take_field(Field* older, Field* newer) {
  if (newer->empty()) newer->Swap(older);
}

std::vector<ShiftBlock> blocks_of(const Blocks& messages) {
  std::vector<ShiftBlock> blocks;
  blocks.reserve(static_cast<std::size_t>(messages.size()));
  for (const v1::ShiftBlock& block : messages) blocks.push_back({block.first(), block.count(), block.by()});
  return blocks;
}

void take_shift(std::vector<ShiftBlock> older, std::vector<ShiftBlock>& newer, std::size_t size) {
  if (older.empty()) return;
  newer = newer.empty() ? std::move(older) : joined(older, newer, size);
}

}  // namespace

std::int64_t most_update_bytes(const PartSizes& sizes) {
  const std::size_t entries = sizes.g + sizes.b + sizes.d + sizes.l;
  std::size_t numbers = sizes.g;  // of a point to start from
#define MARBLE_VECTOR(letter, field) numbers += sizes.letter;
#define MARBLE_MATRIX(letter, field, update, vector) numbers += sizes.letter;
#include "marble/contract.def"
  return kRest + static_cast<std::int64_t>(kBlockBytes * entries + sizeof(double) * numbers);
}

Expected<void> parse_update(grpc::ByteBuffer& bytes, const PartSizes& sizes, v1::SessionRequest* request) {
  const std::int64_t most = most_update_bytes(sizes);
  if (static_cast<std::int64_t>(bytes.Length()) > most) {
    return unexpected(Error{ErrorCode::invalid_argument, "update", -1,
                            std::to_string(bytes.Length()) + " bytes",
                            "must have at most " + std::to_string(most) +
                                " bytes, all numbers of the problem and a block of a shift for each entry"});
  }
  const std::size_t blocks = sizes.g + sizes.b + sizes.d + sizes.l;
  return parse(&bytes, request, kMostFields + static_cast<std::int64_t>(kBlockFields * blocks));
}

Expected<Update> make_update(v1::SessionUpdate& message, const PartSizes& sizes) {
  const auto inside = [](Error error) {
    error.field = "update." + error.field;
    return unexpected(std::move(error));
  };
  if (auto valid = sizes.check(update_of(message.problem())); !valid) {
    Error error = valid.error();
    error.field = "problem." + update_field(error.field);
    return inside(std::move(error));
  }
  Update update{std::move(message), {}, {}};
  const v1::Shift& shift = update.message.shift();
  update.shift = {blocks_of(shift.variables()), blocks_of(shift.equalities()),
                  blocks_of(shift.inequalities()), blocks_of(shift.pairs())};
  update.message.clear_shift();
  if (auto valid = restart_of(update).check(sizes); !valid) {
    Error error = valid.error();
    if (error.field == "initial_z") error.field = "initial_point.z";
    return inside(std::move(error));
  }
  const double deadline_s = update.message.deadline_s();
  if (!(deadline_s >= 0.0)) {
    return inside(
        {ErrorCode::invalid_argument, "deadline_s", -1, std::to_string(deadline_s), "must be >= 0"});
  }
  return update;
}

void take_along(Update older, Update& newer, const PartSizes& sizes) {
  v1::ProblemUpdate& from = *older.message.mutable_problem();
  v1::ProblemUpdate& to = *newer.message.mutable_problem();
  if (from.has_constant() && !to.has_constant()) to.set_constant(from.constant());
#define MARBLE_VECTOR(letter, field) take_field(from.mutable_##field(), to.mutable_##field());
#define MARBLE_MATRIX(letter, field, update, vector) \
  take_field(from.mutable_##update(), to.mutable_##update());
#include "marble/contract.def"
  if (older.message.has_initial_point() && !newer.message.has_initial_point())
    newer.message.mutable_initial_point()->Swap(older.message.mutable_initial_point());
  newer.message.set_cold(older.message.cold() || newer.message.cold());
  take_shift(std::move(older.shift.variables), newer.shift.variables, sizes.g);
  take_shift(std::move(older.shift.equalities), newer.shift.equalities, sizes.b);
  take_shift(std::move(older.shift.inequalities), newer.shift.inequalities, sizes.d);
  take_shift(std::move(older.shift.pairs), newer.shift.pairs, sizes.l);
}

Restart restart_of(const Update& update) {
  const auto& z = update.message.initial_point().z();
  return {{z.data(), static_cast<std::size_t>(z.size())}, update.message.cold(), update.shift};
}

std::int64_t bytes_of(const Update& update) {
  const Shift& shift = update.shift;
  const std::size_t blocks =
      shift.variables.size() + shift.equalities.size() + shift.inequalities.size() + shift.pairs.size();
  return static_cast<std::int64_t>(update.message.ByteSizeLong() + blocks * sizeof(ShiftBlock));
}

}  // namespace marble::server
