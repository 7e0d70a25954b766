// Reads scenarios from files.
#pragma once

#include <deque>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "marble/composite/scenario_samples.h"

namespace marble::cli {

/// The content of a file, and the arrays that it borrows. Must not move.
struct ScenarioFile {
  ScenarioTable table;                                                          ///< from an .npz file
  ScenarioSampler sampler;                                                      ///< from a JSON file
  std::vector<Index> first_stage, own_equalities, own_inequalities, own_pairs;  ///< if the file has them
  std::deque<std::vector<double>> numbers;
  std::deque<std::vector<Index>> positions;
};

/// Reads an .npz file: for every part that varies, c0, g, b, d, l, r, or the values of Q, A, C, L, R, one row
/// per scenario; weights; first_stage, own_equalities, own_inequalities and own_pairs. Errors name the array.
[[nodiscard]] Expected<void> read_samples(const std::string& path, ScenarioFile& file);

/// Reads a JSON file: {"seed": 7, "quantities": [{"distribution": "normal", "location": 0, "scale": 1,
/// "least": -2, "most": 2, "effects": [{"part": "l", "positions": [0, 1], "gains": [1.0]}]}], "first_stage":
/// …}.
[[nodiscard]] Expected<void> read_sampler(const std::string& path, ScenarioFile& file);

/// Parses "0-3,7": ascending numbers and ranges.
[[nodiscard]] Expected<std::vector<Index>> parse_indices(const std::string& text);

}  // namespace marble::cli
