#include "proof/stationarity.h"

#include <algorithm>
#include <cmath>

#include "model/tuning.h"

namespace marble {

std::vector<Index> biactive_pairs(const Images& images) {
  std::vector<Index> pairs;
  const auto s = images.rows.s();
  const auto t = images.rows.t();
  for (Index i = 0; i < static_cast<Index>(s.size()); ++i) {
    if (std::max(s[i], t[i]) <= tuning::zero) pairs.push_back(i);
  }
  return pairs;
}

Stationarity classify(const Images& images, const Iterate& x) {
  const double zero = tuning::zero * (1.0 + std::max(max_abs(x.lambda_L()), max_abs(x.lambda_R())));
  auto kind = Stationarity::strong;
  for (const Index i : biactive_pairs(images)) {
    const double xi = -x.lambda_L()[i];
    const double eta = -x.lambda_R()[i];
    auto here = Stationarity::weak;
    if (xi >= -zero && eta >= -zero) {
      here = Stationarity::strong;
    } else if (std::abs(xi) <= zero || std::abs(eta) <= zero) {
      here = Stationarity::mordukhovich;
    } else if (xi < 0.0 && eta < 0.0) {
      here = Stationarity::clarke;
    }
    kind = std::min(kind, here);
  }
  return kind;
}

}  // namespace marble
