#include "record.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>

#include "marble/research/methods.h"
#include "support/independent_check.h"

namespace marble::suite {
namespace {

double data_size(const OwnedProblem& p) {
  double size = 1.0;
  for (const auto* vector : {&p.b, &p.d, &p.l, &p.r}) {
    for (const double value : *vector) size = std::max(size, std::abs(value));
  }
  return size;
}

}  // namespace

double Record::gap() const { return (objective - reference) / std::max(1.0, std::abs(reference)); }

Record solve_and_judge(const std::string& name, const OwnedProblem& problem, const Options& options,
                       double reference) {
  const Solution s = research::solve_in_process(problem.view(), options).value();
  const testing::Verdict verdict = testing::judge(problem.view(), s);
  Record record;
  record.problem = name;
  record.status = s.status;
  record.objective = s.objective;
  record.reference = reference;
  record.violation = verdict.infeasibility() / data_size(problem);
  record.stationarity = verdict.stationarity;
  record.factorizations = s.factorizations;
  record.milliseconds = 1e3 * (s.times.setup_s + s.times.solve_s);
  record.origin = s.detail.substr(0, s.detail.find(';'));
  return record;
}

double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

void print_header() {
  std::printf("%-18s %-18s %16s %16s %9s %9s %9s %6s %10s  %s\n", "problem", "status", "objective",
              "reference", "gap", "violation", "statio.", "fact.", "ms", "found by");
}

void print(const Record& r) {
  std::printf("%-18s %-18s %16.9g %16.9g %9.1e %9.1e %9.1e %6d %10.3f  %s\n", r.problem.c_str(),
              to_string(r.status), r.objective, r.reference, r.gap(), r.violation, r.stationarity,
              r.factorizations, r.milliseconds, r.origin.c_str());
  std::fflush(stdout);
}

void print_summary(const std::string& family, const std::vector<Record>& records, double gap) {
  std::vector<double> factorizations, milliseconds, gaps;
  int feasible = 0;
  int good = 0;
  for (const Record& r : records) {
    factorizations.push_back(r.factorizations);
    milliseconds.push_back(r.milliseconds);
    gaps.push_back(r.gap());
    feasible += r.feasible();
    good += r.feasible() && r.gap() <= gap;
  }
  std::printf(
      "%s: %zu problems, %d feasible to 1e-9, %d of them within %.0e of the reference; gap median %.1e worst "
      "%.1e; "
      "factorizations median %.0f worst %.0f; ms median %.3f worst %.3f\n\n",
      family.c_str(), records.size(), feasible, good, gap, median(gaps), *std::ranges::max_element(gaps),
      median(factorizations), *std::ranges::max_element(factorizations), median(milliseconds),
      *std::ranges::max_element(milliseconds));
  std::fflush(stdout);
}

}  // namespace marble::suite
