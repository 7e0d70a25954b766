// What each number of core/src/tuning.def does: a sweep over generated families of problems.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace marble::suite {

struct Sweep {
  std::vector<std::string> names;                      ///< of the numbers to vary one by one; empty: all
  std::vector<std::pair<std::string, double>> values;  ///< or these, all at once, against the table's
  int seeds = 10;                                      ///< of each family and half
  bool judging = false;                                ///< on the half that nothing was chosen on
  std::string save;     ///< a file for the outcomes of the table's values, and nothing else is done
  std::string against;  ///< such a file of another table, against which this one's values are printed
};

/// Prints a row for each number and value, or the table of `values`. False, with a word on stderr, if a name
/// is unknown, or if this is not a build of the preset `tune`, the only one in which numbers can be varied.
[[nodiscard]] bool tune(const Sweep& sweep);

}  // namespace marble::suite
