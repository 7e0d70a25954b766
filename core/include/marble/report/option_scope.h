// The conditions under which an option has an effect.
#pragma once

#include <string>
#include <string_view>

#include "marble/options.h"

namespace marble {

/// Returns the condition on other options under which an option has an effect, as its doc begins: "path =
/// paper or algorithm1", "polish = true, path = fast or paper". Empty for an option that always has one.
[[nodiscard]] std::string_view option_scope(std::string_view name);

/// True if these options satisfy the condition of an option.
[[nodiscard]] bool option_counts(const Options& options, std::string_view name);

}  // namespace marble
