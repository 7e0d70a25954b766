#include "marble/restart.h"

#include <algorithm>
#include <string>

namespace marble {
namespace {

Expected<void> check_blocks(std::span<const ShiftBlock> blocks, std::size_t size, const char* name) {
  const auto length = static_cast<std::int64_t>(size);
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const auto check = [&](const char* what, Index value, std::int64_t most) -> Expected<void> {
      if (value >= 0 && value <= most) return {};
      return unexpected(Error{ErrorCode::invalid_argument,
                              std::string("shift.") + name + "[" + std::to_string(i) + "]." + what, -1,
                              std::to_string(value), "must be in [0, " + std::to_string(most) + "]"});
    };
    const ShiftBlock& block = blocks[i];
    auto valid = check("first", block.first, length);
    if (valid) valid = check("count", block.count, length - block.first);
    if (valid) valid = check("by", block.by, block.count);
    if (!valid) return valid;
  }
  return {};
}

}  // namespace

Shift Shift::by_stage(const ProblemView& problem, int stages) {
  const auto block = [stages](std::size_t size) -> std::vector<ShiftBlock> {
    const auto count = static_cast<Index>(size);
    if (count == 0 || stages < 1) return {};
    return {{0, count, count / stages}};
  };
  return {block(problem.g.size()), block(problem.b.size()), block(problem.d.size()), block(problem.l.size())};
}

void shift(std::span<const ShiftBlock> blocks, std::span<double> values) {
  for (const ShiftBlock& block : blocks) {
    const auto begin = values.begin() + block.first;
    std::copy(begin + block.by, begin + block.count, begin);
  }
}

Expected<void> Restart::check(const PartSizes& sizes) const {
  if (!initial_z.empty()) {
    if (auto valid = check_numbers(initial_z, sizes.g, "initial_z"); !valid) return valid;
  }
  auto valid = check_blocks(shift.variables, sizes.g, "variables");
  if (valid) valid = check_blocks(shift.equalities, sizes.b, "equalities");
  if (valid) valid = check_blocks(shift.inequalities, sizes.d, "inequalities");
  if (valid) valid = check_blocks(shift.pairs, sizes.l, "pairs");
  return valid;
}

}  // namespace marble
