// AMPL's .nl files whose functions bend, as problems of nonlinear.h.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "marble/nonlinear.h"
#include "nl/nl_answer.h"

namespace marble::formats {

/// An .nl file as a problem of functions, and the way back to its own rows and variables: that of an LCQP
/// whose blocks are c_E, c_I, G and H.
struct NlNonlinear {
  std::string name;
  /// Its first variables are the file's. Long defined variables are some too, then mixed complementarity adds
  /// two each.
  nonlinear::Problem problem;
  int variables = 0, constraints = 0;  ///< of the file
  std::size_t equalities = 0, inequalities = 0, pairs = 0;
  bool maximize = false;                ///< the problem minimizes the negative
  std::vector<DualTerm> row_duals;      ///< as NlProblem has them
  std::vector<DualTerm> reduced_costs;  ///< of pairs; those of bounds come on top
  NlNames names;

  /// What objective and dual values are to be multiplied by to be the file's.
  [[nodiscard]] double sign() const { return maximize ? -1.0 : 1.0; }
  /// The loop's errors by the file's names: "values.inequalities" of index 3 is a constraint's.
  [[nodiscard]] Error named(Error error) const;
};

/// What parse_nl_problem() takes and more: any smooth function, and abs, min, max, if. Conditions and their
/// variables mean the same. No integers, no imported functions. Functions are by AMPL's library, second
/// derivatives too. Errors name row or variable, that without a value at the initial point too.
[[nodiscard]] Expected<NlNonlinear> parse_nonlinear_nl(std::string_view content, const std::string& name,
                                                       const NlNames& names = {});

/// Views of the answer's multipliers.
[[nodiscard]] MultiplierView multipliers_of(const nonlinear::Answer& answer);

}  // namespace marble::formats
