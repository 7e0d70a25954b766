// The version of Marble, from the build.
#pragma once

namespace marble {

/// Major, minor, patch: "0.1.0".
inline constexpr const char* kVersion = MARBLE_VERSION;

}  // namespace marble
