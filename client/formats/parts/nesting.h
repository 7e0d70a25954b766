// How deep the expressions of an .nl file may nest.
#pragma once

namespace marble::formats {

/// Nodes within nodes at most. The readers, and AMPL's library where it computes, follow each on the stack:
/// 10,000, or what fits the rest of this thread's stack, if that is less.
[[nodiscard]] int deepest_nesting();

}  // namespace marble::formats
