// Performance profiles (Dolan and Moré, 2002): the share of problems a solver solves within a factor of the
// best time.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace marble::suite {

/// Times by solver, one per problem in the same order for all; infinity where it did not solve the problem.
using Times = std::map<std::string, std::vector<double>>;

/// Draws one step curve a solver, as an SVG, over factors from 1 to 1000 on a log scale.
void draw_performance_profile(const Times& times, const std::filesystem::path& file);

}  // namespace marble::suite
