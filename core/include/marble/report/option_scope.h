// For which other options an option counts.
#pragma once

#include <string>
#include <string_view>

#include "marble/options.h"

namespace marble {

/// The condition under which an option changes anything, as its doc begins: "path = paper or algorithm1",
/// "polish = true, path = fast or paper". Empty for an option that counts always.
[[nodiscard]] std::string_view option_scope(std::string_view name);

/// Whether the condition of an option holds for these options.
[[nodiscard]] bool option_counts(const Options& options, std::string_view name);

}  // namespace marble
