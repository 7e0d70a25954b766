#include "service/sensitivity_limits.h"

#include <algorithm>
#include <string>
#include <utility>

#include "marble/convert.h"

namespace marble::server {
namespace {

Expected<void> at_most(std::int64_t limit, std::int64_t value, const char* field, const char* setting) {
  if (value <= limit) return {};
  return unexpected(failure(ErrorCode::resource_exhausted, field, std::to_string(value),
                            "must be at most " + std::to_string(limit) + " (" + setting + ")"));
}

}  // namespace

SensitivityLimits SensitivityLimits::of(const Config& config) {
  return {config.sensitivity_rows, config.sensitivity_directions,
          std::min(config.sensitivity_bytes, config.message_bytes)};
}

Expected<CheckedSensitivity> checked_sensitivity(const v1::SensitivityRequest& message,
                                                 const PartSizes& sizes, const SensitivityLimits& limits) {
  SensitivityRequest request = request_of(message);
  if (auto valid = check(request, sizes); !valid)
    return unexpected(inside("sensitivity", of_field(sensitivity_field(valid.error().field), valid.error())));
  const std::int64_t directions = std::int64_t{request.directions.count} + request.losses.count;
  for (const auto& within :
       {at_most(limits.rows, request.rows ? request.rows->E.rows : 0, "sensitivity.rows.matrix.rows",
                "sensitivity_rows"),
        at_most(limits.directions, directions,
                request.directions.count > 0 ? "sensitivity.directions.count" : "sensitivity.losses.count",
                "sensitivity_directions")}) {
    if (!within) return unexpected(within.error());
  }
  const std::int64_t bytes = static_cast<std::int64_t>(message.ByteSizeLong()) +
                             static_cast<std::int64_t>(std::min(bytes_of(request, sizes), 1e18));
  if (auto within = at_most(limits.bytes, bytes, "sensitivity",
                            "sensitivity_bytes or message_bytes, of request and answer");
      !within) {
    within.error().value += " bytes";
    return unexpected(within.error());
  }
  return CheckedSensitivity{std::move(request), bytes};
}

}  // namespace marble::server
