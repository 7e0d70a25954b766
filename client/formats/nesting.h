// Limits the nesting of expressions in an .nl file.
#pragma once

namespace marble::formats {

/// Returns the most nested nodes. The readers, and AMPL's library when it evaluates, recurse on the stack:
/// 10,000, or what fits the rest of this thread's stack, if that is less.
[[nodiscard]] int deepest_nesting();

}  // namespace marble::formats
