#include "marble/restart.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <tuple>
#include <utility>

namespace marble {
namespace {

// Returns the number of entries that a block moves, at least one.
std::int64_t moved_by(const ShiftBlock& block) {
  return block.by == 0 ? 1 : std::max<std::int64_t>(1, std::int64_t{block.count} - block.by);
}

Expected<void> check_blocks(std::span<const ShiftBlock> blocks, std::size_t size, const char* name) {
  const auto length = static_cast<std::int64_t>(size);
  std::int64_t moved = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    const std::string path = std::string("shift.") + name + "[" + std::to_string(i) + "]";
    const auto check = [&](const char* what, Index value, std::int64_t most) -> Expected<void> {
      if (value >= 0 && value <= most) return {};
      return unexpected(
          invalid(path + what, std::to_string(value), "must be in [0, " + std::to_string(most) + "]"));
    };
    const ShiftBlock& block = blocks[i];
    auto valid = check(".first", block.first, length);
    if (valid) valid = check(".count", block.count, length - block.first);
    if (valid) valid = check(".by", block.by, block.count);
    if (!valid) return valid;
    moved += moved_by(block);
    if (moved > std::max<std::int64_t>(1, length)) {
      return unexpected(invalid(path, std::to_string(moved),
                                "entries are moved by the blocks so far; must be at most " +
                                    std::to_string(length) + ", as many as the vector has"));
    }
  }
  return {};
}

template <class Value>
void move_entries(std::span<const ShiftBlock> blocks, std::span<Value> values) {
  for (const ShiftBlock& block : blocks) {
    if (block.by == 0) continue;
    const auto begin = values.begin() + block.first;
    std::copy(begin + block.by, begin + block.count, begin);
  }
}

}  // namespace

Expected<Shift> Shift::by_stage(const ProblemView& problem, int stages) {
  if (stages < 1) return unexpected(invalid("stages", std::to_string(stages), "must be a whole number >= 1"));
  Shift shift;
  const std::array<std::tuple<const char*, std::size_t, std::vector<ShiftBlock>*>, 4> vectors = {{
      {"variables", problem.g.size(), &shift.variables},
      {"equalities", problem.b.size(), &shift.equalities},
      {"inequalities", problem.d.size(), &shift.inequalities},
      {"pairs", problem.l.size(), &shift.pairs},
  }};
  for (const auto& [name, size, blocks] : vectors) {
    const auto count = static_cast<Index>(size);
    if (count % stages != 0) {
      return unexpected(
          invalid("stages", std::to_string(stages),
                  std::string("must divide the number of ") + name + ", " + std::to_string(count)));
    }
    if (count > 0) blocks->push_back({0, count, count / stages});
  }
  return shift;
}

void shift(std::span<const ShiftBlock> blocks, std::span<double> values) { move_entries(blocks, values); }

// The source of an entry is never before it. Runs of entries with the same distance to their source can
// therefore be moved in place, in ascending order.
std::vector<ShiftBlock> joined(std::span<const ShiftBlock> first, std::span<const ShiftBlock> then,
                               std::size_t size) {
  std::vector<Index> from(size);
  std::iota(from.begin(), from.end(), 0);
  move_entries<Index>(first, from);
  move_entries<Index>(then, from);
  std::vector<ShiftBlock> blocks;
  const auto count = static_cast<Index>(size);
  for (Index begin = 0, end = 0; begin < count; begin = end) {
    const Index by = from[static_cast<std::size_t>(begin)] - begin;
    for (end = begin; end < count && from[static_cast<std::size_t>(end)] - end == by;) ++end;
    if (by > 0) blocks.push_back({begin, end - begin + by, by});
  }
  return blocks;
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
