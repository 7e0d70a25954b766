// What differs by world, as files.
#pragma once

#include <deque>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "marble/composite/worlds.h"

namespace marble::cli {

/// What was read, and the arrays that it borrows. Must stay where it is.
struct ScenarioFile {
  ScenarioTable table;                                                          ///< of an .npz file
  ScenarioSampler sampler;                                                      ///< of a JSON file
  std::vector<Index> first_stage, own_equalities, own_inequalities, own_pairs;  ///< where the file has them
  std::deque<std::vector<double>> numbers;
  std::deque<std::vector<Index>> positions;
};

/// An .npz file: of every part that differs, c0, g, b, d, l, r, or the values of Q, A, C, L, R, one row a
/// world; weights; first_stage, own_equalities, own_inequalities and own_pairs. Errors name the array.
[[nodiscard]] Expected<void> read_samples(const std::string& path, ScenarioFile& file);

/// A JSON file: {"seed": 7, "quantities": [{"distribution": "normal", "location": 0, "scale": 1, "least": -2,
/// "most": 2, "effects": [{"part": "l", "positions": [0, 1], "gains": [1.0]}]}], "first_stage": …}.
[[nodiscard]] Expected<void> read_sampler(const std::string& path, ScenarioFile& file);

/// "0-3,7": ascending numbers and ranges.
[[nodiscard]] Expected<std::vector<Index>> parse_indices(const std::string& text);

}  // namespace marble::cli
