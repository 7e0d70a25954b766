// Prints errors for people on standard error.
#pragma once

#include <string_view>

namespace marble::cli {

/// Prints "marble: WHAT". Text from others in it cannot control the terminal.
void complain(std::string_view what);
/// Prints "marble: SUBJECT: WHAT".
void complain(std::string_view subject, std::string_view what);

}  // namespace marble::cli
