#include "calls/session_update.h"

#include <algorithm>
#include <utility>

#include "base/wire.h"
#include "marble/convert.h"

namespace marble::server {
namespace {

constexpr std::int64_t kRest = 4096;     // bytes of options and everything else that is no array
constexpr std::size_t kBlockBytes = 20;  // maximum, in a message
constexpr double kForEver = 1e9;         // seconds
// Part of an update's deadline for its result to arrive: a tenth, but no more than a busy machine needs.
constexpr double kForAnswer = 0.1;
constexpr double kForAnswerS = 0.004;
constexpr std::size_t kBlockFields = 4;  // including the block itself

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

// Number of entries for which a shift may have a block.
std::size_t entries_of(const PartSizes& sizes) { return sizes.g + sizes.b + sizes.d + sizes.l; }

void take_shift(std::vector<ShiftBlock> older, std::vector<ShiftBlock>& newer, std::size_t size) {
  if (older.empty()) return;
  newer = newer.empty() ? std::move(older) : joined(older, newer, size);
}

}  // namespace

std::int64_t most_update_bytes(const PartSizes& sizes) {
  std::size_t numbers = sizes.g;  // for the starting point
#define MARBLE_VECTOR(letter, field) numbers += sizes.letter;
#define MARBLE_MATRIX(letter, field, update, vector) numbers += sizes.letter;
#include "marble/contract.def"
  return kRest + static_cast<std::int64_t>(kBlockBytes * entries_of(sizes) + sizeof(double) * numbers);
}

Expected<void> parse_update(grpc::ByteBuffer& bytes, const PartSizes& sizes, v1::SessionRequest* request,
                            std::int64_t sensitivity_bytes) {
  const std::int64_t most = most_update_bytes(sizes) + sensitivity_bytes;
  if (static_cast<std::int64_t>(bytes.Length()) > most) {
    return unexpected(invalid("update", std::to_string(bytes.Length()) + " bytes",
                              "must have at most " + std::to_string(most) +
                                  " bytes, all numbers of the problem and a block of a shift for each entry" +
                                  (sensitivity_bytes > 0 ? ", and what may be asked of derivatives" : "")));
  }
  return parse(&bytes, request, kMostFields + static_cast<std::int64_t>(kBlockFields * entries_of(sizes)));
}

Expected<Update> Update::check(v1::SessionUpdate& message, const PartSizes& sizes, const Options& in_force,
                               const SensitivityLimits& derivatives) {
  if (auto valid = sizes.check(update_of(message.problem())); !valid)
    return unexpected(of_field("update.problem." + update_field(valid.error().field), valid.error()));
  Update update(std::move(message), sizes, in_force);
  const v1::Shift& shift = update.message_.shift();
  update.shift_ = {blocks_of(shift.variables()), blocks_of(shift.equalities()),
                   blocks_of(shift.inequalities()), blocks_of(shift.pairs())};
  update.message_.clear_shift();
  if (auto valid = update.restart().check(sizes); !valid)
    return unexpected(inside("update", of_field(message_field(valid.error().field), valid.error())));
  const double deadline_s = update.message_.deadline_s();
  if (!(deadline_s >= 0.0))
    return unexpected(invalid("update.deadline_s", std::to_string(deadline_s), "must be >= 0"));
  if (update.message_.has_sensitivity()) {
    if (update.prepares())
      return unexpected(invalid("update.sensitivity", "must come with the second part of an update"));
    const auto asked = checked_sensitivity(update.message_.sensitivity(), sizes, derivatives);
    if (!asked) return unexpected(inside("update", asked.error()));
    update.sensitivity_bytes_ = asked->bytes;
  }
  if (update.message_.has_options()) {
    const auto options = options_of(update.message_.options(), in_force);
    if (!options) return unexpected(inside("update.options", options.error()));
    if (auto valid = validate_without_explain(*options); !valid)
      return unexpected(inside("update.options", valid.error()));
    update.options_ = *options;
  }
  return update;
}

Clock::time_point Update::deadline() const {
  const double seconds = message_.deadline_s();
  if (seconds == 0.0 || seconds >= kForEver) return Clock::time_point::max();
  return arrival_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

std::int64_t Update::bytes() const {
  const std::size_t blocks =
      shift_.variables.size() + shift_.equalities.size() + shift_.inequalities.size() + shift_.pairs.size();
  return static_cast<std::int64_t>(message_.ByteSizeLong() - message_.sensitivity().ByteSizeLong() +
                                   blocks * sizeof(ShiftBlock));
}

std::optional<SensitivityRequest> Update::sensitivity() const {
  if (!message_.has_sensitivity()) return std::nullopt;
  return request_of(message_.sensitivity());
}

void Update::give_sensitivity_room(std::unique_ptr<Scheduler::Held> room) {
  sensitivity_room_ = std::move(room);
  if (sensitivity_room_ != nullptr) return;
  forget_sensitivity();
  lacks_sensitivity_room_ = true;
}

void Update::forget_sensitivity() {
  message_.clear_sensitivity();
  sensitivity_bytes_ = 0;
  sensitivity_room_ = nullptr;
}

void Update::take_along(Update older) {
  v1::ProblemUpdate& from = *older.message_.mutable_problem();
  v1::ProblemUpdate& to = *message_.mutable_problem();
  if (from.has_constant() && !to.has_constant()) to.set_constant(from.constant());
#define MARBLE_VECTOR(letter, field) take_field(from.mutable_##field(), to.mutable_##field());
#define MARBLE_MATRIX(letter, field, update, vector) \
  take_field(from.mutable_##update(), to.mutable_##update());
#include "marble/contract.def"
  if (message_.initial_point().z().empty())
    message_.mutable_initial_point()->Swap(older.message_.mutable_initial_point());
  message_.set_cold(older.message_.cold() || message_.cold());
  take_shift(std::move(older.shift_.variables), shift_.variables, sizes_.g);
  take_shift(std::move(older.shift_.equalities), shift_.equalities, sizes_.b);
  take_shift(std::move(older.shift_.inequalities), shift_.inequalities, sizes_.d);
  take_shift(std::move(older.shift_.pairs), shift_.pairs, sizes_.l);
}

Restart Update::restart() const {
  const auto& z = message_.initial_point().z();
  return {{z.data(), static_cast<std::size_t>(z.size())}, message_.cold(), shift_};
}

CheckedUpdate Update::checked() const {
  Options options = options_;
  if (const auto end = deadline(); end != Clock::time_point::max()) {
    const double left_s = std::chrono::duration<double>(end - Clock::now()).count() -
                          std::min(kForAnswerS, kForAnswer * message_.deadline_s());
    options.time_limit_s = std::clamp(left_s, 0.0, options.time_limit_s);
  }
  return CheckedUpdate::of_checked(sizes_, update_of(message_.problem()), restart(), options);
}

}  // namespace marble::server
