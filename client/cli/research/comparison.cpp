#include "research/comparison.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>

namespace marble::cli {
namespace {

constexpr double kShownFactors = 10.0;  // at least, on the axis

double share(int count, int of) { return of > 0 ? static_cast<double>(count) / of : 0.0; }

std::string sentence(const PerformanceProfile::Curve& curve, int problems) {
  char text[200];
  if (curve.factors.empty()) {
    std::snprintf(text, sizeof text, " solves none of %d problems.\n", problems);
  } else {
    std::snprintf(
        text, sizeof text,
        " is the fastest on %d of %d problems (%.0f %%), at worst %.1f times slower than the fastest, and "
        "solves %zu.\n",
        curve.fastest, problems, 100.0 * share(curve.fastest, problems), curve.factors.back(),
        curve.factors.size());
  }
  return curve.name + text;
}

}  // namespace

PerformanceProfile::PerformanceProfile(const Times& times) {
  if (!times.empty()) problems_ = static_cast<int>(times.front().second.size());
  std::vector<double> best(static_cast<std::size_t>(problems_), std::numeric_limits<double>::infinity());
  for (const auto& [name, all] : times) {
    for (std::size_t i = 0; i < best.size(); ++i) best[i] = std::min(best[i], all[i]);
  }
  for (const auto& [name, all] : times) {
    Curve curve{name, {}, 0};
    for (std::size_t i = 0; i < best.size(); ++i) {
      if (!std::isfinite(all[i])) continue;
      curve.factors.push_back(best[i] > 0.0 ? all[i] / best[i] : 1.0);
      curve.fastest += all[i] == best[i];
    }
    std::ranges::sort(curve.factors);
    curves_.push_back(std::move(curve));
  }
}

int PerformanceProfile::Curve::within(double factor) const {
  return static_cast<int>(std::ranges::upper_bound(factors, factor) - factors.begin());
}

std::string PerformanceProfile::sentences() const {
  std::string text;
  for (const Curve& curve : curves_) text += sentence(curve, problems_);
  return text;
}

std::string PerformanceProfile::csv() const {
  std::set<double> factors = {1.0};
  std::string text = "factor";
  for (const Curve& curve : curves_) {
    factors.insert(curve.factors.begin(), curve.factors.end());
    text += "," + curve.name;
  }
  for (const double factor : factors) {
    text += "\n" + gnuplot_number(factor);
    for (const Curve& curve : curves_) text += "," + gnuplot_number(share(curve.within(factor), problems_));
  }
  return text + "\n";
}

std::string PerformanceProfile::picture(PictureFormat format, const std::string& title) const {
  double last = kShownFactors;
  for (const Curve& curve : curves_) {
    if (!curve.factors.empty()) last = std::max(last, curve.factors.back());
  }
  last = std::pow(10.0, std::ceil(std::log10(last)));
  std::string text = gnuplot_style(format), plots;
  for (std::size_t c = 0; c < curves_.size(); ++c) {
    const Curve& curve = curves_[c];
    const std::string block = "$curve" + std::to_string(c);
    text += block + " << END_OF_CURVE\n1 0\n";
    for (std::size_t i = 0; i < curve.factors.size(); ++i)
      text += gnuplot_number(curve.factors[i]) + " " +
              gnuplot_number(share(static_cast<int>(i) + 1, problems_)) + "\n";
    text += gnuplot_number(last) + " " +
            gnuplot_number(share(static_cast<int>(curve.factors.size()), problems_)) + "\nEND_OF_CURVE\n";
    plots += (c > 0 ? ", \\\n  " : "") + block + " using 1:($2*100) with steps linewidth 2 linecolor " +
             gnuplot_colour(c) + " title '" + gnuplot_text(curve.name) + "'";
  }
  text += "set title '" + gnuplot_text(title) +
          "' noenhanced\nset logscale x 10\nset xrange [1:" + gnuplot_number(last) +
          "]\nset yrange [0:102]\n" +
          "set xlabel 'time over the time of the fastest'\nset ylabel 'problems solved, percent of " +
          std::to_string(problems_) + "'\n";
  return text + "plot " + plots + "\n";
}

namespace {

// The file that peers read the problem from.
class SharedFile {
 public:
  explicit SharedFile(const ProblemFile& problem) {
    std::string path = (std::filesystem::temp_directory_path() / "marble-XXXXXX.json").string();
    const int handle = mkstemps(path.data(), 5);
    if (handle < 0) return;
    close(handle);
    path_ = path;
    std::ofstream file(path_);
    file << write_problem(problem, FileFormat::json);
    if (!file.flush()) remove();
  }
  ~SharedFile() { remove(); }
  SharedFile(const SharedFile&) = delete;
  SharedFile& operator=(const SharedFile&) = delete;

  /// Empty if it could not be written.
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  void remove() {
    if (!path_.empty()) std::remove(path_.c_str());
    path_.clear();
  }
  std::string path_;
};

constexpr const char* kRecorded =
    "name,solver,status,objective,equality,inequality,complementarity,iterations,ms";

std::optional<Entry> recorded_entry(const std::string& line) {
  Entry entry;
  Measures measures;
  double milliseconds = 0.0;
  std::istringstream cells(line);
  std::string number;
  bool good = true;
  const auto text = [&](std::string& value) {
    good &= bool(std::getline(cells, value, ',')) && !value.empty();
  };
  const auto next = [&](double& value) {
    text(number);
    char* end = nullptr;
    value = std::strtod(number.c_str(), &end);
    good &= end != number.c_str();
  };
  double iterations = 0.0;
  text(entry.problem);
  text(entry.contestant);
  text(entry.attempt.status);
  for (double* value : {&measures.objective, &measures.equality, &measures.inequality, &measures.smaller_side,
                        &iterations, &milliseconds})
    next(*value);
  if (!good) return std::nullopt;
  measures.product = std::numeric_limits<double>::quiet_NaN();
  entry.measures = measures;
  entry.seconds = {1e-3 * milliseconds};
  return entry;
}

void judge(std::vector<Entry>& entries, std::size_t first, const ProblemFile& problem,
           const ComparisonSettings& settings) {
  double reference = problem.best_known_objective.value_or(std::numeric_limits<double>::infinity());
  for (std::size_t k = first; k < entries.size(); ++k) {
    const auto& measures = entries[k].measures;
    if (measures && measures->feasible(settings.tolerance, settings.pairs))
      reference = std::min(reference, measures->objective);
  }
  for (std::size_t k = first; k < entries.size(); ++k) {
    Entry& entry = entries[k];
    entry.reference = reference;
    entry.solved = entry.measures && entry.measures->feasible(settings.tolerance, settings.pairs) &&
                   entry.excess() <= settings.gap;
  }
}

}  // namespace

double Entry::excess() const {
  return measures ? (measures->objective - reference) / std::max(1.0, std::abs(reference))
                  : std::numeric_limits<double>::quiet_NaN();
}

PerformanceProfile Comparison::profile() const {
  PerformanceProfile::Times times;
  for (const Entry& entry : entries) {
    auto own = std::ranges::find(times, entry.contestant, &PerformanceProfile::Times::value_type::first);
    if (own == times.end()) own = times.insert(times.end(), {entry.contestant, {}});
    own->second.push_back(entry.solved ? entry.median_s() : std::numeric_limits<double>::infinity());
  }
  return PerformanceProfile(times);
}

Expected<std::vector<Entry>> read_recorded(const std::string& path) {
  std::ifstream file(path);
  if (!file) return unexpected(failure(ErrorCode::not_found, path, "cannot be read"));
  std::vector<Entry> entries;
  std::string line;
  std::getline(file, line);
  for (int number = 2; std::getline(file, line); ++number) {
    if (line.empty()) continue;
    auto entry = recorded_entry(line);
    if (!entry)
      return unexpected(invalid(path, "line " + std::to_string(number) + " must have " + kRecorded));
    entries.push_back(std::move(*entry));
  }
  return entries;
}

Expected<Comparison> compare(const std::vector<ProblemFile>& problems,
                             const std::vector<Contestant>& contestants, const std::vector<Entry>& recorded,
                             const ComparisonSettings& settings, const std::stop_token& stop) {
  Comparison comparison;
  for (const ProblemFile& problem : problems) {
    const SharedFile file(problem);
    if (file.path().empty())
      return unexpected(failure(ErrorCode::internal, "a temporary file", std::strerror(errno)));
    std::vector<Entry> of_problem(contestants.size());
    for (int run = 0; run < settings.runs; ++run) {
      for (std::size_t c = 0; c < contestants.size(); ++c) {
        Attempt made = attempt(contestants[c], problem.problem, file.path(), settings.time_limit_s, stop);
        if (stop.stop_requested()) {
          comparison.interrupted = true;
          return comparison;
        }
        Entry& entry = of_problem[c];
        entry.seconds.push_back(made.seconds);
        if (run > 0) continue;
        entry.problem = problem.problem.name;
        entry.contestant = contestants[c].name;
        if (!made.z.empty()) entry.measures = measure(problem.problem, made.z);
        entry.attempt = std::move(made);
      }
    }
    const std::size_t first = comparison.entries.size();
    for (Entry& entry : of_problem) {
      std::ranges::sort(entry.seconds);
      comparison.entries.push_back(std::move(entry));
    }
    for (const Entry& entry : recorded) {
      if (entry.problem == problem.problem.name) comparison.entries.push_back(entry);
    }
    judge(comparison.entries, first, problem, settings);
  }
  return comparison;
}

}  // namespace marble::cli
