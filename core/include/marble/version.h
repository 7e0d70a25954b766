// The version of Marble, from the build.
#pragma once

namespace marble {

inline constexpr const char* kVersion = MARBLE_VERSION;

}  // namespace marble
