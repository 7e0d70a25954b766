#include "session.h"

#include <algorithm>
#include <utility>

#include "marble/convert.h"

namespace marble::server {
namespace {

Error fault(std::string field, std::string value, std::string bound) {
  return {ErrorCode::invalid_argument, std::move(field), -1, std::move(value), std::move(bound)};
}

template <class Field>
void take_field(Field* older, Field* newer) {
  if (newer->empty()) newer->Swap(older);
}

using Blocks = google::protobuf::RepeatedPtrField<v1::ShiftBlock>;

void prepend(const Blocks& older, Blocks* newer) {
  Blocks both = older;
  both.MergeFrom(*newer);
  newer->Swap(&both);
}

Expected<void> check_blocks(const Blocks& blocks, std::size_t size, const char* name) {
  for (int i = 0; i < blocks.size(); ++i) {
    const v1::ShiftBlock& block = blocks[i];
    const auto out_of_range = [&](const char* what, std::int32_t value, std::int64_t most) {
      return unexpected(fault(std::string("shift.") + name + "[" + std::to_string(i) + "]." + what,
                              std::to_string(value), "must be in [0, " + std::to_string(most) + "]"));
    };
    const auto length = static_cast<std::int64_t>(size);
    if (block.first() < 0 || block.first() > length) return out_of_range("first", block.first(), length);
    if (block.count() < 0 || block.count() > length - block.first())
      return out_of_range("count", block.count(), length - block.first());
    if (block.by() < 0 || block.by() > block.count()) return out_of_range("by", block.by(), block.count());
  }
  return {};
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

void shift(const Blocks& blocks, std::vector<double>& values) {
  for (const v1::ShiftBlock& block : blocks) {
    const auto begin = values.begin() + block.first();
    std::copy(begin + block.by(), begin + block.count(), begin);
  }
}

Session::Session(const Problem& problem, const Options& options)
    : sizes_(PartSizes::of(problem)), scaling_passes_(options.scaling_passes) {}

Expected<void> Session::set_up(const Problem& problem, std::span<const double> initial_z,
                               std::int64_t most_bytes) {
  Options options;
  options.scaling_passes = scaling_passes_;
  const auto begin = std::chrono::steady_clock::now();
  auto solver = Solver::create(problem, options, most_bytes);
  if (!solver) return unexpected(solver.error());
  solver_ = std::make_unique<Solver>(std::move(*solver));
  setup_s_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  initial_z_.assign(initial_z.begin(), initial_z.end());
  return {};
}

std::int64_t Session::memory_bytes() const {
  const auto vectors = static_cast<std::int64_t>(3 * sizes_.g + sizes_.b + sizes_.d + 2 * sizes_.l);
  return solver_ == nullptr ? 0
                            : solver_->memory_bytes() + vectors * static_cast<std::int64_t>(sizeof(double));
}

Expected<void> Session::check(const v1::SessionUpdate& update) const {
  if (auto valid = sizes_.check(update_of(update.problem())); !valid) {
    Error error = valid.error();
    error.field = update_field(error.field);
    return unexpected(std::move(error));
  }
  const auto& z = update.initial_point().z();
  if (!z.empty()) {
    const std::span values(z.data(), static_cast<std::size_t>(z.size()));
    if (auto valid = check_numbers(values, sizes_.g, "initial_point.z"); !valid) return valid;
  }
  if (!(update.deadline_s() >= 0.0))
    return unexpected(fault("deadline_s", std::to_string(update.deadline_s()), "must be >= 0"));
  auto valid = check_blocks(update.shift().variables(), sizes_.g, "variables");
  if (valid) valid = check_blocks(update.shift().equalities(), sizes_.b, "equalities");
  if (valid) valid = check_blocks(update.shift().inequalities(), sizes_.d, "inequalities");
  if (valid) valid = check_blocks(update.shift().pairs(), sizes_.l, "pairs");
  return valid;
}

void Session::prepare_start(const v1::SessionUpdate& update) {
  if (update.cold()) last_.reset();
  if (last_) {
    const v1::Shift& hint = update.shift();
    shift(hint.variables(), last_->z);
    shift(hint.equalities(), last_->equality_multipliers);
    shift(hint.inequalities(), last_->inequality_multipliers);
    shift(hint.pairs(), last_->complementarity_multipliers_L);
    shift(hint.pairs(), last_->complementarity_multipliers_R);
  }
  if (const auto& z = update.initial_point().z(); !z.empty()) {
    initial_z_.assign(z.begin(), z.end());
    if (last_) last_->z = initial_z_;
  }
}

Expected<Solution> Session::solve(const v1::SessionUpdate& update, const Options& options,
                                  const SolveControls& given) {
  if (auto taken = solver_->update(update_of(update.problem())); !taken) return unexpected(taken.error());
  if (auto set = solver_->set_options(options); !set) return unexpected(set.error());
  prepare_start(update);
  SolveControls controls = given;
  controls.initial_z = initial_z_;
  if (last_) controls.warm_start = &*last_;
  auto solution = solver_->solve(controls);
  if (solution) solution->times.setup_s = 0.0;  // told once, when it was set up
  if (solution && is_solved(solution->status)) last_ = *solution;
  return solution;
}

}  // namespace marble::server
