// SIMD batches of problems: up to eight problems of one kind, one in each lane of a number.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "kkt/lanes.h"
#include "marble/problem.h"

namespace marble {

/// As many problems from number `first` on as T has lanes. Only the first `count` are valid; the other lanes
/// repeat the first one.
template <class T>
class Batch {
 public:
  Batch(Index first, int count) : first_(first), count_(count) {}
  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] Index number(int lane) const { return first_ + (lane < count_ ? lane : 0); }

  /// Returns entry i of each problem's part of `values`; a part has `size` numbers.
  [[nodiscard]] T read(std::span<const double> values, std::size_t size, Index i) const {
    const double* const first = values.data() + static_cast<std::size_t>(first_) * size + i;
    if (count_ == lanes_of<T>)
      return made_of<T>([&](int lane) { return first[static_cast<std::size_t>(lane) * size]; });
    return made_of<T>(
        [&](int lane) { return first[lane < count_ ? static_cast<std::size_t>(lane) * size : 0]; });
  }
  void write(const T& value, std::vector<double>& to, std::size_t size, Index i) const {
    double* const first = to.data() + static_cast<std::size_t>(first_) * size + i;
    for_each([&](int k) { first[static_cast<std::size_t>(k) * size] = lane(value, k); });
  }
  /// Calls work(lane) for the valid lanes; unrolled, as in Lanes.
  template <class Work>
  void for_each(const Work& work) const {
    [&]<int... I>(std::integer_sequence<int, I...>) { (void)((I < count_ && (work(I), true)) && ...); }
    (std::make_integer_sequence<int, lanes_of<T>>());
  }

 private:
  Index first_;
  int count_;
};

/// Runs work() in batches of 8; the rest runs in the smallest batch that holds it. Returns false as soon as
/// work() does.
template <class Work>
bool in_batches(Index count, const Work& work) {
  for (Index first = 0; first < count; first += 8) {
    const int here = std::min<Index>(8, count - first);
    const bool goes_on = here > 4   ? work(Batch<Lanes<8>>(first, here))
                         : here > 2 ? work(Batch<Lanes<4>>(first, here))
                         : here > 1 ? work(Batch<Lanes<2>>(first, here))
                                    : work(Batch<double>(first, here));
    if (!goes_on) return false;
  }
  return true;
}

}  // namespace marble
