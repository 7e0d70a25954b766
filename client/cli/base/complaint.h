// Errors for people, on standard error.
#pragma once

#include <string_view>

namespace marble::cli {

/// "marble: WHAT". Text of others in it cannot steer the terminal.
void complain(std::string_view what);
/// "marble: SUBJECT: WHAT"
void complain(std::string_view subject, std::string_view what);

}  // namespace marble::cli
