// Provides the settings of the nonlinear loop as words name=value.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "marble/nonlinear.h"

namespace marble::cli {

/// A setting beside the options of each LCQP.
struct NonlinearWord {
  const char* name;
  const char* doc;
  const char* value;  ///< the default
};
[[nodiscard]] std::span<const NonlinearWord> nonlinear_words();
[[nodiscard]] bool is_nonlinear_word(std::string_view name);

/// Sets one of nonlinear_words(), or an option of each LCQP; time_limit_s applies to all of them together.
/// Errors: invalid_argument, with the name.
[[nodiscard]] Expected<void> set_nonlinear_text(nonlinear::Settings& settings, const std::string& name,
                                                const std::string& value);

}  // namespace marble::cli
