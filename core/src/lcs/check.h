// Checks that all parts of a planning problem share.
#pragma once

#include <span>
#include <string>

#include "marble/error.h"

namespace marble {

/// Checks that numbers are finite, of one stage or stage after stage with `entries` each. The error's field
/// is `field`, or "field[stage]".
[[nodiscard]] Expected<void> check_stages(std::span<const double> values, std::size_t entries,
                                          const std::string& field);

}  // namespace marble
