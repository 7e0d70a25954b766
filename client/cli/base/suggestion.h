// Finds what a misspelled name may have meant.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace marble::cli {

/// Returns the known names that resemble `given`, the best first, at most three; empty if none does.
[[nodiscard]] std::vector<std::string> similar_names(std::string_view given,
                                                     const std::vector<std::string>& known);

/// Returns "; did you mean A or B?", or nothing if no known name resembles `given`.
[[nodiscard]] std::string did_you_mean(std::string_view given, const std::vector<std::string>& known);

}  // namespace marble::cli
