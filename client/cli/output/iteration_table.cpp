#include "output/iteration_table.h"

#include <unistd.h>

#include <cstdlib>

namespace marble::cli {
namespace {

constexpr int kRowsBetweenHeaders = 40;
constexpr double kTroublesomeRegularization = 1e-8;
constexpr const char* kBold = "\033[1m";
constexpr const char* kYellow = "\033[33m";
constexpr const char* kPlain = "\033[0m";

}  // namespace

bool colours_wanted() {
  const char* no_color = std::getenv("NO_COLOR");
  return isatty(STDERR_FILENO) == 1 && (no_color == nullptr || *no_color == '\0');
}

void IterationTable::report(const Progress& p) {
  if (rows_++ % kRowsBetweenHeaders == 0) {
    std::fprintf(to_, "%s%5s %14s %9s %9s %9s %9s %9s %8s %7s %8s %5s%s\n", colours_ ? kBold : "", "iter",
                 "objective", "equality", "inequal.", "complem.", "residual", "kappa", "rho", "step",
                 "regular.", "fact", colours_ ? kPlain : "");
  }
  // A raised regularization is where a solve has trouble: make it stand out.
  const bool trouble = colours_ && p.regularization > kTroublesomeRegularization;
  std::fprintf(to_, "%s%5d %14.7e %9.2e %9.2e %9.2e %9.2e %9.2e %8.1e %7.4f %8.1e %5d%s\n",
               trouble ? kYellow : "", p.iteration, p.objective, p.violations.equality,
               p.violations.inequality, p.violations.complementarity, p.kkt_residual, p.kappa, p.rho,
               p.step_length, p.regularization, p.factorizations, trouble ? kPlain : "");
}

}  // namespace marble::cli
