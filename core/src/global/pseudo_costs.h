// Selects the pair to branch on by the gains of earlier fixings. (Benichou et al., "Experiments in
// mixed-integer linear programming", 1971.)
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/rows.h"
#include "model/tuning.h"

namespace marble {

class PseudoCosts {
 public:
  explicit PseudoCosts(Index pairs) : sides_(2 * static_cast<std::size_t>(pairs)) {}

  /// The increase of the bound when a side that was `amount` away from zero was fixed.
  struct Gain {
    Index pair = -1;  ///< −1: none
    bool s = false;
    double amount = 0.0, gain = 0.0;
  };
  void add(const Gain& gain) {
    if (gain.pair < 0 || !(gain.amount > 0.0) || !std::isfinite(gain.gain)) return;
    Mean& mean = side(gain.pair, gain.s);
    mean.sum += gain.gain / gain.amount;
    mean.count += 1.0;
    all_.sum += gain.gain / gain.amount;
    all_.count += 1.0;
  }

  /// Returns the score of a pair whose sides are s and t; higher is better.
  [[nodiscard]] double score(Index pair, double s, double t) const {
    return std::max(expected(pair, true) * s, tuning::near) *
           std::max(expected(pair, false) * t, tuning::near);
  }

  /// Returns the expected increase of the bound if a side that is `amount` away from zero is fixed.
  [[nodiscard]] double gain(Index pair, bool s, double amount) const { return expected(pair, s) * amount; }

 private:
  struct Mean {
    double sum = 0.0, count = 0.0;
  };
  [[nodiscard]] Mean& side(Index pair, bool s) {
    return sides_[2 * static_cast<std::size_t>(pair) + (s ? 0 : 1)];
  }
  [[nodiscard]] double expected(Index pair, bool s) const {
    const Mean& own = sides_[2 * static_cast<std::size_t>(pair) + (s ? 0 : 1)];
    const Mean& mean = own.count > 0.0 ? own : all_;
    return mean.count > 0.0 ? mean.sum / mean.count : 1.0;
  }

  std::vector<Mean> sides_;  // s, then t, of each pair
  Mean all_;
};

}  // namespace marble
