#include "output/iteration_table.h"

#include <unistd.h>

#include <cstdlib>

namespace marble::cli {
namespace {

constexpr int kRowsBetweenHeaders = 40;
constexpr double kBetweenTreeRows_s = 0.2;
constexpr double kTroublesomeRegularization = 1e-8;
constexpr const char* kBold = "\033[1m";
constexpr const char* kYellow = "\033[33m";
constexpr const char* kPlain = "\033[0m";

}  // namespace

bool colours_wanted() {
  const char* no_color = std::getenv("NO_COLOR");
  return isatty(STDERR_FILENO) == 1 && (no_color == nullptr || *no_color == '\0');
}

void IterationTable::heading(const char* names) {
  if (rows_++ % kRowsBetweenHeaders == 0)
    std::fprintf(to_, "%s%s%s\n", colours_ ? kBold : "", names, colours_ ? kPlain : "");
}

// Rounds of nodes come by the thousand: what they have changed is told a few times a second.
void IterationTable::tree_row(const Progress& p) {
  const bool better = p.incumbent < told_.incumbent;
  if (told_.nodes > 0 && !better && p.elapsed_s < told_.elapsed_s + kBetweenTreeRows_s) return;
  heading("    nodes     open      incumbent          bound       gap  nodes/s      time");
  const double seconds = p.elapsed_s - told_.elapsed_s;
  const double speed = seconds > 0.0 ? static_cast<double>(p.nodes - told_.nodes) / seconds : 0.0;
  std::fprintf(to_, "%9lld %8lld %14.7e %14.7e %9.2e %8.0f %8.2fs\n", static_cast<long long>(p.nodes),
               static_cast<long long>(p.open_nodes), p.incumbent, p.bound, p.gap, speed, p.elapsed_s);
  told_ = without_vectors(p);
}

void IterationTable::report(const Progress& p) {
  const bool tree = p.nodes > 0;
  if (tree != tree_) rows_ = 0;
  tree_ = tree;
  if (tree) return tree_row(p);
  heading(
      " iter      objective  equality  inequal.  complem.  residual     kappa      rho    step regular.  "
      "fact");
  // A raised regularization is where a solve has trouble: make it stand out.
  const bool trouble = colours_ && p.regularization > kTroublesomeRegularization;
  std::fprintf(to_, "%s%5d %14.7e %9.2e %9.2e %9.2e %9.2e %9.2e %8.1e %7.4f %8.1e %5d%s\n",
               trouble ? kYellow : "", p.iteration, p.objective, p.violations.equality,
               p.violations.inequality, p.violations.complementarity, p.kkt_residual, p.kappa, p.rho,
               p.step_length, p.regularization, p.factorizations, trouble ? kPlain : "");
  told_ = without_vectors(p);
}

}  // namespace marble::cli
