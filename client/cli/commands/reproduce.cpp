// Reproduces the tables and figures of "Complementarity by Construction", one of "Retrospective
// Approximation" and two of "ALADIN-β" with this program instead of their authors'.
#include <iostream>
#include <map>
#include <memory>

#include "base/atomic_file.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "base/interrupt.h"
#include "commands/commands.h"
#include "marble/examples.h"
#include "marble/macmpec.h"
#include "marble/published_examples.h"
#include "research/comparison_arguments.h"
#include "research/reproductions.h"

namespace marble::cli {
namespace {

struct ReproduceArguments : ComparisonArguments {
  std::string what;
  std::vector<std::string> files;
  int seeds = 20, levels = 18;
  nonlinear::LevelTest test = nonlinear::LevelTest::merit;
};

// This solver with its defaults; the printed algorithm with the constants, tolerances and first
// regularization of its authors' code (include/solver.h of their repository); and Algorithm 1 to the letter.
const std::vector<std::string> kOwn = {
    "marble",
    "authors: path=paper polish=false scaling_passes=0 max_local_search_factorizations=0 rho_initial=10 "
    "kappa_min=1e-7 "
    "inner_tolerance=1e-6 max_iterations=1000 regularization_initial=1e-8 equality_tolerance=1e-4 "
    "inequality_tolerance=1e-4 complementarity_tolerance=1e-3 stationarity_tolerance=1e-5",
    "algorithm1: path=algorithm1 max_iterations=1000 complementarity_tolerance=1e-7"};

constexpr const char* kTableOne =
    "\nThe paper's Table I, as printed; * is proved:\n"
    "          contact dynamics   progress constraints   state-triggered constraints\n"
    "Gurobi    29.20  344.56 s    464.46*  898 ms        380.71*  45 ms\n"
    "LCQPow    29.21   72.38 s    not feasible           not feasible\n"
    "Marble    31.68  170 ms      465.56    73 ms        381.19   37 ms\n"
    "Contact dynamics is the hopper, progress constraints are the gates, state-triggered constraints the\n"
    "rocket. The gates were published with other numbers than the table's.\n";

constexpr const char* kRetraction =
    "\nThe paper's section IV.A, in words only: the exponential map suffers from numerical ill-conditioning "
    "due\nto unbounded gradients; those of the softplus are between 0 and 1. cond: of the whole KKT matrix "
    "of "
    "(13),\nwhere the inner loop has ended, in the 1-norm.\n";

constexpr const char* kRetrospective =
    "The paper's theory: the error falls like 1/sqrt(samples), by as many solves a level. KKT: of BT6 "
    "itself, "
    "which\nthe noise leaves alone on the average; its quartiles are over the seeds. Steps and LCQPs: so "
    "far.\n";

constexpr const char* kAladin =
    "\nThe first iterations from which on it holds, of the worst seed that comes to 1e-10; worst end: the "
    "error in the\nend, of all. The paper's text on figure 2: ALADIN-beta has 1e-10 in the fewest "
    "iterations, and products of\n1e-16 within about 20; IPOPT-vanilla has 1e-9 in 42, IPOPT2 1e-8 in about "
    "180, 90 of them slow ones; IPOPT1 is\nslow. The methods here are our own, not IPOPT. s and t are "
    "complementary pair by pair: the single product that is\nprinted came to 1e-8 in no setting tried. (1, "
    "1) "
    "is as near to (1, 0) as to (0, 1): the first multipliers of all\nt are .001 larger, which decides. Fall "
    "back: the merit did not fall, and l1_barrier went on from the best point.\n";

constexpr const char* kFigureFour =
    "\nThe paper's Figure 4 and its text: Marble is the fastest on 69 % of 39 problems of MacMPEC and at "
    "most 8\n"
    "times slower than the fastest; all 39 are feasible, 38 global. LCQPow finds 33.\n";

std::vector<ProblemFile> table_one() {
  std::vector<ProblemFile> problems(3);
  problems[0].problem = examples::published_hopper();
  problems[1].problem = examples::published_gates();
  problems[2].problem = examples::published_rocket();
  return problems;
}

std::vector<ProblemFile> macmpec() {
  std::vector<ProblemFile> problems;
  for (const examples::MacmpecProblem& each : examples::macmpec())
    problems.push_back({each.problem(), each.optimum, false});
  return problems;
}

// The paper's three families, ours, and some without structure.
std::vector<ProblemFile> families() {
  std::vector<ProblemFile> problems = table_one();
  const auto add = [&problems](OwnedProblem problem) {
    problems.emplace_back().problem = std::move(problem);
  };
  add(examples::hopper({.steps = 20}));
  add(examples::rocket());
  add(examples::gates());
  for (const std::uint64_t seed : {1, 2, 3, 4}) add(examples::qpec({}, seed));
  return problems;
}

// The criteria that the authors' code applies to its own solutions.
void judge_as_authors(ComparisonArguments& arguments) {
  arguments.settings.tolerance = 1e-4;
  arguments.settings.pairs = PairMeasure::product;
}

int reproduce(const ComparisonArguments& arguments, const std::vector<ProblemFile>& problems,
              const char* title, const char* printed) {
  const auto contestants = contestants_of(arguments, kOwn);
  if (!contestants) return option_fails(contestants.error());
  const int exit_code = compare_and_report(arguments, problems, *contestants, title);
  std::cout << printed << std::flush;
  return exit_code;
}

int fails(const std::string& message) {
  complain(message);
  return kBadInput;
}

// Uses the authors' constants on both paths.
int reproduce_retraction(const ReproduceArguments& arguments, const std::vector<ProblemFile>& files) {
  const auto contestants = contestants_of(arguments, {kOwn[1]});
  if (!contestants) return option_fails(contestants.error());
  const auto* const options = std::get_if<Options>(&contestants->front().solver);
  if (contestants->size() != 1 || options == nullptr)
    return fails("retraction has no peers, and one --with at most: the options of both paths");
  std::vector<ProblemFile> problems = families();
  problems.insert(problems.end(), files.begin(), files.end());
  const Interrupt interrupt;
  const auto pairs = compare_retractions(problems, *options, interrupt.token());
  if (!pairs) return fails(pairs.error().message());
  std::cout << retraction_report(*pairs) << kRetraction << std::flush;
  return kAllSolved;
}

// True if the arguments select other problems or settings.
bool has_others(const ReproduceArguments& a) {
  return !(a.files.empty() && a.with.empty() && a.methods.empty() && a.peers.empty() && a.recorded.empty() &&
           a.solver.options.empty() && a.solver.time_limit_s.empty());
}

// Prints a table with its summary, and writes the requested files.
int report(const ReproduceArguments& arguments, const TextTable& table, const std::string& said,
           const std::string& csv, const std::function<std::string(PictureFormat)>& picture) {
  std::cout << table.text() << said << std::flush;
  if (!arguments.table.empty()) {
    auto file = AtomicFile::open(arguments.table);
    if (!file) return fails(file.error().message());
    file->write(table.as(table_format(arguments.table)));
    if (auto written = file->commit(); !written) return fails(written.error().message());
  }
  if (arguments.profile.empty()) return kAllSolved;
  const auto drawn = write_figure(arguments.profile, csv, picture);
  return drawn ? kAllSolved : fails(drawn.error().message());
}

int no_runs(const Error& error) {
  complain(error.message());
  return error.code == ErrorCode::cancelled ? kNotSolved : exit_code_of_local(error);
}

int reproduce_aladin(const ReproduceArguments& arguments) {
  if (has_others(arguments))
    return fails(
        "aladin-figures has no FILE, no solvers beside and no options but --seeds, --table and --figure");
  const Interrupt interrupt;
  const auto runs = aladin_runs(arguments.seeds, interrupt.token());
  if (!runs) return no_runs(runs.error());
  return report(arguments, aladin_table(*runs), kAladin, aladin_csv(*runs),
                [&runs](PictureFormat format) { return aladin_picture(*runs, format); });
}

int reproduce_retrospective(const ReproduceArguments& arguments) {
  if (has_others(arguments))
    return fails(
        "ra-bt6 has no FILE, no solvers beside and no options but --seeds, --levels, --test, --table "
        "and --figure");
  const Interrupt interrupt;
  const auto levels = levels_of_seeds(arguments.seeds, arguments.levels, arguments.test, interrupt.token());
  if (!levels) return no_runs(levels.error());
  return report(arguments, levels_table(*levels),
                "\n" + levels_summary(*levels, arguments.seeds) + kRetrospective, levels_csv(*levels),
                [&levels](PictureFormat format) { return levels_picture(*levels, format); });
}

int run(const ReproduceArguments& arguments) {
  if (arguments.what == "aladin-figures") return reproduce_aladin(arguments);
  if (arguments.what == "ra-bt6") return reproduce_retrospective(arguments);
  const bool table = arguments.what == "table1";
  if (table && !arguments.files.empty()) return fails("table1 has problems of its own, and no FILE");
  if (table) return reproduce(arguments, table_one(), "Table I", kTableOne);
  const auto problems = read_all(arguments.files);
  if (!problems) return fails(problems.error().message());
  if (arguments.what == "retraction") return reproduce_retraction(arguments, *problems);
  return reproduce(arguments, problems->empty() ? macmpec() : *problems, "Figure 4", kFigureFour);
}

}  // namespace

void add_reproduce(CLI::App& program, int& exit_code) {
  CLI::App* command = program.add_subcommand(
      "reproduce", "Reproduce the tables and figures of the papers, on request beside other solvers");
  auto arguments = std::make_shared<ReproduceArguments>();
  command
      ->add_option(
          "WHAT", arguments->what,
          "table1: hopper, gates and rocket as the paper's authors published them; figure4: the performance "
          "profile of the 39 problems of MacMPEC, or of the files; retraction: softplus against exponential "
          "on "
          "the path, table1's problems, ours and those of the files; ra-bt6: retrospective approximation of "
          "BT6 "
          "under noise; aladin-figures: ALADIN-beta and penalty-barriers on its paper's example")
      ->required()
      ->check(CLI::IsMember({"table1", "figure4", "retraction", "ra-bt6", "aladin-figures"}));
  command->add_option("FILE", arguments->files,
                      "problems in any format: for figure4 in place of MacMPEC, for retraction in addition");
  command
      ->add_option(
          "--seeds", arguments->seeds,
          "number of seeds of ra-bt6, which reports their median, and of aladin-figures; the first is 0")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command
      ->add_option("--levels", arguments->levels,
                   "stages of ra-bt6, each with twice the samples of the one before")
      ->check(CLI::Range(1, 26))
      ->capture_default_str();
  command
      ->add_option(
          "--test", arguments->test,
          "measure that ends a stage of ra-bt6: merit (a tenth of the first value) or step (half of it)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, nonlinear::LevelTest>{
          {"merit", nonlinear::LevelTest::merit}, {"step", nonlinear::LevelTest::step}}));
  judge_as_authors(*arguments);
  add_comparison_arguments(*command, *arguments);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
