// Which characters the terminal shows.
#pragma once

namespace marble::cli {

/// Takes the user's locale for characters, and for nothing else: numbers stay as they are. True if it is a
/// UTF-8 one. Where the one that is asked for is UTF-8 but not installed, as over ssh, C.UTF-8 stands in.
[[nodiscard]] bool set_terminal_locale();

}  // namespace marble::cli
