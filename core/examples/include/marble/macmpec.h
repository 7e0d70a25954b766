// The 39 problems of MacMPEC, S. Leyffer's collection of mathematical programs with equilibrium constraints,
// that are LCQPs: the set of the papers of LCQPow and of Marble. They are written from their published
// formulations, without fixed variables, with bounds as rows of C, and without bounds that a pair implies.
#pragma once

#include <span>
#include <string_view>

#include "marble/problem.h"

namespace marble::examples {

/// A problem of the collection.
struct MacmpecProblem {
  std::string_view name;    ///< the collection's, with _ for . and -
  std::string_view source;  ///< who published it
  double optimum;           ///< global, to 12 digits; proved by branch and bound
  /// Returns the problem, with the collection's starting point where it has one.
  OwnedProblem (*problem)();
};

/// Returns all 39, sorted by name.
[[nodiscard]] std::span<const MacmpecProblem> macmpec();

/// Returns the problem of that name; null if there is none.
[[nodiscard]] const MacmpecProblem* find_macmpec(std::string_view name);

}  // namespace marble::examples
