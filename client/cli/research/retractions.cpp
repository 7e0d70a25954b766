#include <algorithm>
#include <cmath>

#include "base/median.h"
#include "output/text_table.h"
#include "research/reproductions.h"

namespace marble::cli {
namespace {

// Returns the condition at the first κ at or below this one; infinite if a path did not reach it.
double condition_at(const PathConditions& path, double kappa) {
  const auto at = std::ranges::find_if(path.at, [&](const PathCondition& c) { return c.kappa <= kappa; });
  return at == path.at.end() ? std::numeric_limits<double>::infinity() : at->condition;
}

std::string number(const char* form, double value) {
  return std::isfinite(value) ? formatted(form, value) : "-";
}

std::string summary(const std::vector<RetractionPair>& pairs) {
  int solved[2] = {0, 0}, both = 0, iterations[2] = {0, 0};
  for (const RetractionPair& pair : pairs) {
    const bool by[2] = {is_solved(pair.softplus.status), is_solved(pair.exponential.status)};
    for (const int k : {0, 1}) solved[k] += by[k];
    if (!by[0] || !by[1]) continue;
    ++both;
    iterations[0] += pair.softplus.iterations;
    iterations[1] += pair.exponential.iterations;
  }
  TextTable table({"retraction", "problems", "solved", "failures", "iterations where both solve"});
  const auto add = [&](const char* name, int k) {
    table.add({name, std::to_string(pairs.size()), std::to_string(solved[k]),
               std::to_string(static_cast<int>(pairs.size()) - solved[k]),
               std::to_string(iterations[k]) + " on " + std::to_string(both)});
  };
  add("softplus", 0);
  add("exponential", 1);
  return table.text();
}

// Uses only problems for which both paths reach κ: else a path that fails early would look well conditioned.
std::string by_kappa(const std::vector<RetractionPair>& pairs) {
  TextTable table({"kappa", "problems", "cond, softplus", "cond, exponential", "median of their ratios"});
  for (int power = -2; power >= -7; --power) {
    // A path's κ are halvings of the first one.
    const double kappa = 1.1 * std::pow(10.0, power);
    std::vector<double> conditions[2], ratios;
    for (const RetractionPair& pair : pairs) {
      const double by[2] = {condition_at(pair.softplus, kappa), condition_at(pair.exponential, kappa)};
      if (!std::isfinite(by[0]) || !std::isfinite(by[1])) continue;
      for (const int k : {0, 1}) conditions[k].push_back(by[k]);
      ratios.push_back(by[1] / by[0]);
    }
    if (ratios.empty()) continue;
    table.add({formatted("%.0e", std::pow(10.0, power)), std::to_string(ratios.size()),
               number("%.1e", median(conditions[0])), number("%.1e", median(conditions[1])),
               number("%.2g", median(ratios))});
  }
  return table.text();
}

}  // namespace

Expected<std::vector<RetractionPair>> compare_retractions(const std::vector<ProblemFile>& problems,
                                                          const Options& options,
                                                          const std::stop_token& stop) {
  SolveControls controls;
  controls.stop = stop;
  std::vector<RetractionPair> pairs;
  for (const ProblemFile& file : problems) {
    MARBLE_ASSIGN_OR_RETURN(const auto problem, Problem::create(file.problem.view()));
    RetractionPair pair{file.problem.name, {}, {}};
    for (const Retraction retraction : {Retraction::softplus, Retraction::exponential}) {
      Options by = options;
      by.retraction = retraction;
      MARBLE_ASSIGN_OR_RETURN(auto path, path_conditions(problem, by, controls));
      (retraction == Retraction::softplus ? pair.softplus : pair.exponential) = std::move(path);
    }
    pairs.push_back(std::move(pair));
  }
  return pairs;
}

std::string retraction_report(const std::vector<RetractionPair>& pairs) {
  TextTable table(
      {"problem", "softplus", "iterations", "largest cond", "exponential", "iterations", "largest cond"});
  const auto largest = [](const PathConditions& path) {
    double most = 0.0;
    for (const PathCondition& at : path.at) most = std::max(most, at.condition);
    return path.at.empty() ? std::string("-") : number("%.1e", most);
  };
  for (const RetractionPair& pair : pairs) {
    table.add({pair.problem, to_string(pair.softplus.status), std::to_string(pair.softplus.iterations),
               largest(pair.softplus), to_string(pair.exponential.status),
               std::to_string(pair.exponential.iterations), largest(pair.exponential)});
  }
  return table.text() + "\n" + summary(pairs) + "\n" + by_kappa(pairs);
}

}  // namespace marble::cli
