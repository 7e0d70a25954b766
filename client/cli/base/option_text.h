// Formats option values for people, as the command line accepts them.
#pragma once

#include <string>

#include "marble/options.h"

namespace marble::cli {

[[nodiscard]] std::string option_text(const OptionInfo& option, double value);

}  // namespace marble::cli
