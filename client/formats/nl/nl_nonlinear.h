// Reads AMPL's .nl files with nonlinear functions as problems of nonlinear.h.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "marble/nonlinear.h"
#include "nl/nl_answer.h"

namespace marble::formats {

/// An .nl file as a problem of functions, with the mapping back to its own rows and variables: that of an
/// LCQP whose blocks are c_E, c_I, G and H.
struct NlNonlinear {
  std::string name;
  /// Its first variables are the file's. Long defined variables follow, then two for each mixed
  /// complementarity.
  nonlinear::Problem problem;
  int variables = 0, constraints = 0;  ///< of the file
  std::size_t equalities = 0, inequalities = 0, pairs = 0;
  bool maximize = false;                ///< the problem minimizes the negative
  std::vector<DualTerm> row_duals;      ///< as in NlProblem
  std::vector<DualTerm> reduced_costs;  ///< of pairs; those of bounds are added
  NlNames names;

  /// Returns the factor from objective and dual values to the file's.
  [[nodiscard]] double sign() const { return maximize ? -1.0 : 1.0; }
  /// Returns the loop's error with the file's names: "values.inequalities" of index 3 is a constraint's.
  [[nodiscard]] Error named(Error error) const;
};

/// Accepts the input of parse_nl_problem() and more: any smooth function, and abs, min, max, if. Conditions
/// and their variables have the same meaning. No integers, no imported functions. AMPL's library evaluates
/// functions and both derivatives. Errors name row or variable, including a function without a value at the
/// initial point.
[[nodiscard]] Expected<NlNonlinear> parse_nonlinear_nl(std::string_view content, const std::string& name,
                                                       const NlNames& names = {});

/// Returns views of the solution's multipliers.
[[nodiscard]] MultiplierView multipliers_of(const nonlinear::Answer& answer);

}  // namespace marble::formats
