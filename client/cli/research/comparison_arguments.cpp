#include "research/comparison_arguments.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <string>

#include "base/atomic_file.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "formats.h"
#include "output/text_table.h"
#include "plain_text.h"
#include "research/comparison.h"

namespace marble::cli {
namespace {

// Formats a comparison as tables and pictures.

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

// Returns a row per problem and contestant.
std::string comparison_table(const Comparison& comparison, TableFormat format) {
  TextTable table(header());
  for (const Entry& entry : comparison.entries) table.add(cells(entry));
  return table.as(format);
}

// Returns the totals per contestant: how many are feasible by either measure, how many solved; and the
// profile's sentences.
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

// Returns a line for each missing solution with its reason; empty if there is none.
std::string comparison_faults(const Comparison& comparison) {
  std::string text;
  for (const Entry& entry : comparison.entries) {
    if (!entry.attempt.fault.empty())
      text += without_controls(entry.problem + ": " + entry.contestant + ": " + entry.attempt.fault) + "\n";
  }
  return text;
}

// Writes the profile in the format of the file's extension: .png, .svg or .csv. The error's field is the
// file.
Expected<void> write_profile(const PerformanceProfile& profile, const std::string& title,
                             const std::string& path) {
  return write_figure(path, profile.csv(),
                      [&](PictureFormat format) { return profile.picture(format, title); });
}

int fails(const Error& error) {
  complain(error.message());
  return kBadInput;
}

Expected<void> write_table(const Comparison& comparison, const std::string& path) {
  MARBLE_ASSIGN_OR_RETURN(auto file, AtomicFile::open(path));
  file.write(comparison_table(comparison, table_format(path)));
  return file.commit();
}

Expected<void> write_files(const ComparisonArguments& arguments, const Comparison& comparison,
                           const std::string& title) {
  if (!arguments.table.empty()) {
    MARBLE_RETURN_IF_ERROR(write_table(comparison, arguments.table));
  }
  if (arguments.profile.empty()) return {};
  return write_profile(comparison.profile(), title, arguments.profile);
}

bool solved_by_first(const Comparison& comparison) {
  return std::ranges::all_of(comparison.entries, [&comparison](const Entry& entry) {
    return entry.solved || entry.contestant != comparison.entries.front().contestant;
  });
}

}  // namespace

void add_comparison_arguments(CLI::App& command, ComparisonArguments& arguments) {
  add_solver_arguments(command, arguments.solver);
  command
      .add_option("--with", arguments.with,
                  "'NAME: OPTION=VALUE ...': this solver by these options, in process; may be repeated")
      ->allow_extra_args(false);
  command
      .add_option(
          "--methods", arguments.methods,
          "methods of option method, with commas between: this solver and those of others, in process")
      ->delimiter(',');
  command
      .add_option(
          "--peer", arguments.peers,
          "'NAME: COMMAND': a program that takes a problem's JSON file as its last argument and prints "
          "a line {\"status\": ..., \"z\": [...], \"seconds\": ...}; may be repeated")
      ->allow_extra_args(false);
  command
      .add_option("--recorded", arguments.recorded,
                  "CSV of what others reached before: name,solver,status,objective,equality,inequality,"
                  "complementarity,iterations,ms; may be repeated")
      ->allow_extra_args(false);
  command
      .add_option("--runs", arguments.settings.runs, "of each on each problem, in turns; the median counts")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command
      .add_option("--tolerance", arguments.settings.tolerance,
                  "largest violation of a feasible point, in the problem's units")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command
      .add_option("--pairs", arguments.settings.pairs,
                  "how far a pair is from being complementary: its smaller_side, or the product of its sides")
      ->transform(CLI::CheckedTransformer(std::map<std::string, PairMeasure>{
          {"smaller_side", PairMeasure::smaller_side}, {"product", PairMeasure::product}}));
  command
      .add_option("--gap", arguments.settings.gap,
                  "how far above the best objective a solved one may be, relative, or absolute below 1")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  command.add_option("--table", arguments.table, "write the table to a file: .md, .csv, or text");
  command.add_option("--profile,--figure", arguments.profile,
                     "write the performance profile to a file: .svg or .png by gnuplot, else CSV");
}

Expected<std::vector<Contestant>> contestants_of(const ComparisonArguments& arguments,
                                                 const std::vector<std::string>& own) {
  MARBLE_ASSIGN_OR_RETURN(const auto base, parse_research_options(arguments.solver));
  std::vector<Contestant> all;
  for (const std::string& text : arguments.with.empty() && arguments.methods.empty() ? own : arguments.with) {
    MARBLE_ASSIGN_OR_RETURN(auto contestant, contestant_by_options("--with", text, base));
    all.push_back(std::move(contestant));
  }
  for (const std::string& method : arguments.methods) {
    Options options = base;
    if (auto set = set_option_text(options, "method", method); !set)
      return unexpected(of_field("--methods", set.error()));
    all.push_back({method, options});
  }
  for (const std::string& text : arguments.peers) {
    MARBLE_ASSIGN_OR_RETURN(auto contestant, contestant_by_command("--peer", text));
    all.push_back(std::move(contestant));
  }
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (std::ranges::count(all, all[k].name, &Contestant::name) > 1)
      return unexpected(invalid("--with, --methods and --peer", all[k].name, "must be names that differ"));
  }
  return all;
}

Expected<std::vector<ProblemFile>> read_all(const std::vector<std::string>& paths) {
  std::vector<ProblemFile> problems;
  for (const std::string& path : paths) {
    auto problem = formats::read_any_problem(path);
    if (!problem) return unexpected(of_field(path, problem.error()));
    problems.push_back(std::move(*problem));
  }
  return problems;
}

int compare_and_report(const ComparisonArguments& arguments, const std::vector<ProblemFile>& problems,
                       const std::vector<Contestant>& contestants, const std::string& title) {
  ComparisonSettings settings = arguments.settings;
  const double limit = parse_research_options(arguments.solver)->time_limit_s;
  if (!arguments.solver.time_limit_s.empty()) settings.time_limit_s = limit;
  std::vector<Entry> recorded;
  for (const std::string& path : arguments.recorded) {
    auto entries = read_recorded(path);
    if (!entries) return fails(entries.error());
    recorded.insert(recorded.end(), entries->begin(), entries->end());
  }
  const Interrupt interrupt;
  const auto comparison = compare(problems, contestants, recorded, settings, interrupt.token());
  if (!comparison) return fails(comparison.error());
  if (!comparison->entries.empty())
    std::cout << comparison_table(*comparison, TableFormat::text) << '\n'
              << comparison_summary(*comparison, settings) << std::flush;
  std::cerr << comparison_faults(*comparison);
  if (comparison->interrupted) {
    complain("interrupted: what came after is missing");
    return kNotSolved;
  }
  if (auto written = write_files(arguments, *comparison, title); !written) return fails(written.error());
  return solved_by_first(*comparison) ? kAllSolved : kNotSolved;
}

}  // namespace marble::cli
