// Writes AMPL's .sol files, text: D. M. Gay, "Hooking Your Solver to AMPL" (1997), and its suffixes.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "marble/problem.h"

namespace marble::formats {

/// Numbers beside the solution, for variables, constraints, objectives or the problem itself.
struct SolSuffix {
  enum class Of { variables = 0, constraints = 1, objectives = 2, problem = 3 };
  std::string name;
  Of of;
  std::vector<std::pair<Index, double>> values;  ///< index and value; missing values are 0
};

/// The content of a .sol file.
struct SolFile {
  std::string message;                      ///< lines; an empty one would end the message and is dropped
  std::vector<int> options = {};            ///< as in the .nl file's header
  std::optional<double> vb_tolerance = {};  ///< likewise
  int constraints = 0, variables = 0;       ///< of the .nl file
  std::vector<double> duals = {};           ///< by constraint, or none
  std::vector<double> primals = {};         ///< by variable, or none
  std::optional<int> code = {};  ///< solve_result_num; without it this line and the suffixes are omitted
  std::vector<SolSuffix> suffixes = {};
};

/// Returns the file's text; numbers keep every bit.
[[nodiscard]] std::string sol_text(const SolFile& sol);

}  // namespace marble::formats
