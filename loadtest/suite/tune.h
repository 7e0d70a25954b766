// Measures the effect of each number of core/src/model/tuning.def: a sweep over generated families of
// problems.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace marble::suite {

struct Sweep {
  std::vector<std::string> names;                      ///< the numbers to vary one by one; empty: all
  std::vector<std::pair<std::string, double>> values;  ///< or these, all at once, compared with the table's
  int seeds = 10;                                      ///< per family and half
  bool judging = false;                                ///< uses the half that no number was tuned on
  std::string save;     ///< a file for the outcomes of the table's values; nothing else is done
  std::string against;  ///< such a file of another table, with which this one's values are compared
};

/// Prints a row for each number and value, or the table of `values`. Returns false, with a message on stderr,
/// if a name is unknown, or if this is not a build of the preset `tune`, the only one in which numbers can be
/// varied.
[[nodiscard]] bool tune(const Sweep& sweep);

}  // namespace marble::suite
