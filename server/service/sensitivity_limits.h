// Limits on the derivatives of a solution that a request asks for.
#pragma once

#include <cstdint>

#include "config/config.h"
#include "marble/sensitivity.h"
#include "marble/v1/sensitivity.pb.h"

namespace marble::server {

struct SensitivityLimits {
  int rows = 0;
  int directions = 0;      ///< and losses
  std::int64_t bytes = 0;  ///< size of request and result

  [[nodiscard]] static SensitivityLimits of(const Config& config);
};

/// A request that fits its problem and the limits; views its message.
struct CheckedSensitivity {
  SensitivityRequest request;
  std::int64_t bytes = 0;  ///< size of request and result
};

/// Error fields begin with "sensitivity.". Errors: invalid_argument, resource_exhausted (a limit).
[[nodiscard]] Expected<CheckedSensitivity> checked_sensitivity(const v1::SensitivityRequest& message,
                                                               const PartSizes& sizes,
                                                               const SensitivityLimits& limits);

}  // namespace marble::server
