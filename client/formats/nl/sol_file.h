// AMPL's .sol files, text: D. M. Gay, "Hooking Your Solver to AMPL" (1997), and its suffixes.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "marble/problem.h"

namespace marble::formats {

/// Numbers beside the answer, of variables, constraints, objectives or of the problem itself.
struct SolSuffix {
  enum class Of { variables = 0, constraints = 1, objectives = 2, problem = 3 };
  std::string name;
  Of of;
  std::vector<std::pair<Index, double>> values;  ///< index and value; what is not there is 0
};

/// What a .sol file says.
struct SolFile {
  std::string message;                      ///< lines; an empty one would end it, and is left out
  std::vector<int> options = {};            ///< as the .nl file's header has them
  std::optional<double> vb_tolerance = {};  ///< likewise
  int constraints = 0, variables = 0;       ///< of the .nl file
  std::vector<double> duals = {};           ///< by constraint, or none
  std::vector<double> primals = {};         ///< by variable, or none
  std::optional<int> code = {};             ///< solve_result_num; none leaves out this line and the suffixes
  std::vector<SolSuffix> suffixes = {};
};

/// Its text; numbers keep every bit.
[[nodiscard]] std::string sol_text(const SolFile& sol);

}  // namespace marble::formats
