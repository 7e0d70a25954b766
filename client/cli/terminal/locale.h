// Determines which characters the terminal can show.
#pragma once

namespace marble::cli {

/// Sets the user's locale for characters only: number formats do not change. Returns true if it is a UTF-8
/// locale. If the requested locale is UTF-8 but not installed, as over ssh, uses C.UTF-8.
[[nodiscard]] bool set_terminal_locale();

}  // namespace marble::cli
