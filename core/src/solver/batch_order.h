// The order in which the elements of a batch are solved, and the solved ones that are near each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace marble {

/// A part of the numbers of a batch: `size` for each element.
struct BatchPart {
  std::span<const double> values;
  std::size_t size;
};

/// Depends only on the numbers, with the same bits on any number of threads.
class BatchOrder {
 public:
  /// All values must be finite. Each of the first elements (at most tuning::batch_kept) in the order is the
  /// one that is farthest from those before it; the others follow by their index.
  BatchOrder(std::size_t count, std::span<const BatchPart> parts);

  /// The elements in their order.
  [[nodiscard]] std::span<const std::size_t> elements() const { return order_; }
  /// How many of them others may start from.
  [[nodiscard]] std::size_t kept() const { return kept_; }
  /// Fills `nearest` with positions in the order for which `usable` is not 0, at most `most` (>= 1) of them,
  /// the nearest to the element first; of equally near ones the lower position.
  void find_nearest(std::size_t element, std::span<const std::uint8_t> usable, std::size_t most,
                    std::vector<std::size_t>& nearest) const;

 private:
  [[nodiscard]] double distance(std::size_t a, std::size_t b) const;

  std::size_t dimensions_ = 0;
  std::size_t kept_ = 0;
  std::vector<double> points_;  // an element's place, row by row
  std::vector<std::size_t> order_;
};

}  // namespace marble
