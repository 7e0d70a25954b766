#include "research/comparison_table.h"

#include <algorithm>
#include <cmath>

#include "plain_text.h"

namespace marble::cli {
namespace {

struct Column {
  const char* name;
  std::string (*cell)(const Entry&);
};

std::string of_measure(const Entry& entry, double Measures::*which) {
  const double value = entry.measures ? (*entry.measures).*which : std::nan("");
  return std::isfinite(value) ? formatted("%.1e", value) : "";
}

std::string count(const Entry& entry, int value) {
  return entry.attempt.factorizations > 0 ? std::to_string(value) : "";
}

std::string seconds(const Entry& entry, double value) {
  return entry.measures ? formatted("%.3g", value) : "";
}

const Column kColumns[] = {
    {"problem", [](const Entry& e) { return e.problem; }},
    {"solver", [](const Entry& e) { return e.contestant; }},
    {"status", [](const Entry& e) { return e.attempt.status; }},
    {"solved", [](const Entry& e) { return std::string(e.solved ? "yes" : "no"); }},
    {"objective",
     [](const Entry& e) { return e.measures ? formatted("%.9g", e.measures->objective) : std::string(); }},
    {"excess",
     [](const Entry& e) {
       return std::isfinite(e.excess()) ? formatted("%.1e", e.excess()) : std::string();
     }},
    {"equality", [](const Entry& e) { return of_measure(e, &Measures::equality); }},
    {"inequality", [](const Entry& e) { return of_measure(e, &Measures::inequality); }},
    {"max|min(s,t)|", [](const Entry& e) { return of_measure(e, &Measures::smaller_side); }},
    {"max|s*t|", [](const Entry& e) { return of_measure(e, &Measures::product); }},
    {"iterations", [](const Entry& e) { return count(e, e.attempt.iterations); }},
    {"factorizations", [](const Entry& e) { return count(e, e.attempt.factorizations); }},
    {"seconds", [](const Entry& e) { return seconds(e, e.median_s()); }},
    {"least", [](const Entry& e) { return seconds(e, e.seconds.front()); }},
    {"most", [](const Entry& e) { return seconds(e, e.seconds.back()); }},
};

std::vector<std::string> header() {
  std::vector<std::string> names;
  for (const Column& column : kColumns) names.emplace_back(column.name);
  return names;
}

std::vector<std::string> cells(const Entry& entry) {
  std::vector<std::string> all;
  for (const Column& column : kColumns) all.push_back(column.cell(entry));
  return all;
}

std::vector<std::string> contestants_of(const Comparison& comparison) {
  std::vector<std::string> names;
  for (const Entry& entry : comparison.entries) {
    if (std::ranges::find(names, entry.contestant) == names.end()) names.push_back(entry.contestant);
  }
  return names;
}

}  // namespace

std::string comparison_table(const Comparison& comparison, TableFormat format) {
  TextTable table(header());
  for (const Entry& entry : comparison.entries) table.add(cells(entry));
  return table.as(format);
}

std::string comparison_summary(const Comparison& comparison, const ComparisonSettings& settings) {
  TextTable table({"solver", "problems", "feasible", "feasible by s*t", "solved"});
  for (const std::string& name : contestants_of(comparison)) {
    int problems = 0, feasible = 0, by_product = 0, solved = 0;
    for (const Entry& entry : comparison.entries) {
      if (entry.contestant != name) continue;
      ++problems;
      feasible += entry.measures && entry.measures->feasible(settings.tolerance, PairMeasure::smaller_side);
      by_product += entry.measures && entry.measures->feasible(settings.tolerance, PairMeasure::product);
      solved += entry.solved;
    }
    table.add({name, std::to_string(problems), std::to_string(feasible), std::to_string(by_product),
               std::to_string(solved)});
  }
  return table.text() + "feasible: within " + formatted("%g", settings.tolerance) +
         (settings.pairs == PairMeasure::product ? "; solved: feasible by s*t, and within "
                                                 : "; solved: feasible, and within ") +
         formatted("%g", settings.gap) + " of the best objective known\n" + comparison.profile().sentences();
}

std::string comparison_faults(const Comparison& comparison) {
  std::string text;
  for (const Entry& entry : comparison.entries) {
    if (!entry.attempt.fault.empty())
      text += without_controls(entry.problem + ": " + entry.contestant + ": " + entry.attempt.fault) + "\n";
  }
  return text;
}

Expected<void> write_profile(const PerformanceProfile& profile, const std::string& title,
                             const std::string& path) {
  return write_figure(path, profile.csv(),
                      [&](PictureFormat format) { return profile.picture(format, title); });
}

}  // namespace marble::cli
