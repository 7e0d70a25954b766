// Holds the content of an .nl file before its conversion to an LCQP.
#pragma once

#include <string>
#include <vector>

#include "assembler.h"
#include "marble/error.h"
#include "nl/nl_names.h"
#include "nl/nl_problem.h"
#include "nl/quadratic.h"

namespace marble::formats {

/// The k of "5 k i": the bounds of variable i that the row complements.
enum Sides : int { kLowerSide = 1, kUpperSide = 2, kBothSides = 3 };

/// Bounds of a row or a variable.
struct NlBounds {
  double low = -kInfinity, high = kInfinity;
  int complements = -1;  ///< the variable that the row complements
  int sides = 0;         ///< the complemented bounds of that variable
};

/// A row, a variable or another part of the model.
struct NlPlace {
  enum class Kind { none, row, column, objective, definition };
  Kind kind = Kind::none;
  int index = 0;

  /// Returns the error with the name of its row or variable.
  [[nodiscard]] Error named(Error error, const NlNames& names) const;
};

/// Rows and objective as polynomials, in the file's own numbering.
struct NlModel {
  bool maximize = false;
  Quadratic objective = {};
  std::vector<Quadratic> rows = {};  ///< linear
  std::vector<NlBounds> row_bounds = {}, bounds = {};
  std::vector<double> initial = {}, duals = {};  ///< by variable and by row, or empty
  bool bounds_apart = false;  ///< whether bounds go to NlProblem::bounds, not into the LCQP
};

/// Errors: contradictory bounds or conditions, by their rows and variables.
[[nodiscard]] Expected<NlProblem> as_lcqp(NlModel model, const std::string& name, const NlNames& names);

}  // namespace marble::formats
