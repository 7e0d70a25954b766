// What an .nl file says, read but not yet an LCQP.
#pragma once

#include <string>
#include <vector>

#include "marble/error.h"
#include "nl/nl_names.h"
#include "nl/nl_problem.h"
#include "nl/quadratic.h"
#include "parts/assembler.h"

namespace marble::formats {

/// The k of "5 k i": which bounds of variable i the row complements.
enum Sides : int { kLowerSide = 1, kUpperSide = 2, kBothSides = 3 };

/// Of a row or a variable.
struct NlBounds {
  double low = -kInfinity, high = kInfinity;
  int complements = -1;  ///< the variable that the row complements
  int sides = 0;         ///< with regard to which of its bounds
};

/// A row, a variable or another part of the model.
struct NlPlace {
  enum class Kind { none, row, column, objective, definition };
  Kind kind = Kind::none;
  int index = 0;

  /// The error, and whose it is.
  [[nodiscard]] Error named(Error error, const NlNames& names) const;
};

/// Rows and objective as polynomials, by the file's own numbers.
struct NlModel {
  bool maximize = false;
  Quadratic objective = {};
  std::vector<Quadratic> rows = {};  ///< linear
  std::vector<NlBounds> row_bounds = {}, bounds = {};
  std::vector<double> initial = {}, duals = {};  ///< by variable and by row, or empty
  bool bounds_apart = false;                     ///< into NlProblem::bounds, not into the LCQP
};

/// Errors: bounds or conditions that contradict themselves, by their rows and variables.
[[nodiscard]] Expected<NlProblem> as_lcqp(NlModel model, const std::string& name, const NlNames& names);

}  // namespace marble::formats
