#include "output/iteration_table.h"

#include <unistd.h>

#include <cstdlib>

namespace marble::cli {
namespace {

constexpr int kRowsBetweenHeaders = 40;
constexpr double kBetweenTreeRows_s = 0.2;
constexpr std::chrono::milliseconds kQuiet{500}, kQuietInFile{2000};
constexpr double kTroublesomeRegularization = 1e-8;
constexpr const char* kBold = "\033[1m";
constexpr const char* kYellow = "\033[33m";
constexpr const char* kPlain = "\033[0m";
constexpr const char* kEraseLine = "\r\033[K";

}  // namespace

bool colours_wanted() {
  const char* no_color = std::getenv("NO_COLOR");
  return isatty(STDERR_FILENO) == 1 && (no_color == nullptr || *no_color == '\0');
}

void IterationTable::heading(const char* names) {
  if (rows_++ % kRowsBetweenHeaders == 0)
    std::fprintf(to_, "%s%s%s\n", colours_ ? kBold : "", names, colours_ ? kPlain : "");
}

// There are thousands of rounds of nodes: their changes are reported a few times a second.
void IterationTable::tree_row(const Progress& p) {
  const bool better = p.incumbent < reported_.incumbent;
  if (reported_.nodes > 0 && !better && p.elapsed_s < reported_.elapsed_s + kBetweenTreeRows_s) return;
  heading("    nodes     open      incumbent          bound       gap  nodes/s      time");
  const double seconds = p.elapsed_s - reported_.elapsed_s;
  const double speed = seconds > 0.0 ? static_cast<double>(p.nodes - reported_.nodes) / seconds : 0.0;
  std::fprintf(to_, "%9lld %8lld %14.7e %14.7e %9.2e %8.0f %8.2fs\n", static_cast<long long>(p.nodes),
               static_cast<long long>(p.open_nodes), of_file(p.incumbent), of_file(p.bound), p.gap, speed,
               p.elapsed_s);
  reported_ = without_vectors(p);
}

void IterationTable::erase_line() {
  if (open_line_) std::fputs(kEraseLine, to_);
  open_line_ = false;
}

void IterationTable::clear() {
  const std::scoped_lock lock(mutex_);
  erase_line();
  std::fflush(to_);
}

void IterationTable::show(const std::string& activity) {
  const std::scoped_lock lock(mutex_);
  const auto quiet = std::chrono::steady_clock::now() - written_;
  if (isatty(fileno(to_)) == 1) {
    if (quiet < kQuiet && !open_line_) return;
    erase_line();
    std::fprintf(to_, "  %s", activity.c_str());
    open_line_ = true;
  } else {
    if (quiet < kQuietInFile || activity == shown_) return;
    std::fprintf(to_, "  %s\n", activity.c_str());
    written_ = std::chrono::steady_clock::now();
  }
  shown_ = activity;
  std::fflush(to_);
}

void IterationTable::report(const Progress& p) {
  const std::scoped_lock lock(mutex_);
  erase_line();
  written_ = std::chrono::steady_clock::now();
  const bool tree = p.nodes > 0;
  if (tree != tree_) rows_ = 0;
  tree_ = tree;
  if (tree) return tree_row(p);
  heading(
      " iter      objective  equality  inequal.  complem.  residual     kappa      rho    step regular.  "
      "fact");
  // A raised regularization indicates trouble: it is highlighted.
  const bool trouble = colours_ && p.regularization > kTroublesomeRegularization;
  std::fprintf(to_, "%s%5d %14.7e %9.2e %9.2e %9.2e %9.2e %9.2e %8.1e %7.4f %8.1e %5d%s\n",
               trouble ? kYellow : "", p.iteration, of_file(p.objective), p.violations.equality,
               p.violations.inequality, p.violations.complementarity, p.kkt_residual, p.kappa, p.rho,
               p.step_length, p.regularization, p.factorizations, trouble ? kPlain : "");
  reported_ = without_vectors(p);
}

ActivityDisplay::ActivityDisplay(IterationTable& table)
    : table_(table), thread_([this](const std::stop_token& stop) { run(stop); }) {}

ActivityDisplay::~ActivityDisplay() {
  thread_.request_stop();
  thread_.join();
  table_.clear();
}

void ActivityDisplay::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, stop, kQuiet, [&] { return stop.stop_requested(); }))
    table_.show(describe(monitor_.read()));
}

}  // namespace marble::cli
