#include <algorithm>
#include <cmath>
#include <numbers>

#include "research/reproductions.h"

namespace marble::cli {
namespace {

constexpr double kStart = 2.0;  // x₀, of every variable

}  // namespace

nonlinear::SampledProblem SampledBt6::sampled() {
  nonlinear::SampledProblem made;
  made.use_samples = [this](std::int64_t N) {
    for (; samples_ < N; ++samples_) sum_ += 2 * random_.uniform(static_cast<std::uint64_t>(samples_)) - 1;
    mean_ = sum_ / static_cast<double>(N);
  };
  made.problem.start.assign(5, kStart);
  made.problem.values = [this](std::span<const double> x) -> nonlinear::Values {
    double f = std::pow(x[0] - 1, 2) + std::pow(x[0] - x[1], 2) + std::pow(x[2] - 1, 2) +
               std::pow(x[3] - 1, 4) + std::pow(x[4] - 1, 6);
    for (const double entry : x) f += mean_ * std::pow(entry - kStart - 1, 2);
    evaluate_rows(x);
    return {.objective = f, .equalities = rows_};
  };
  made.problem.derivatives = [this](std::span<const double> x) -> nonlinear::Derivatives {
    differentiate(x);
    for (std::size_t j = 0; j < x.size(); ++j) gradient_[j] += 2 * mean_ * (x[j] - kStart - 1);
    return {.gradient = gradient_, .equalities = jacobian_.view()};
  };
  return made;
}

void SampledBt6::evaluate_rows(std::span<const double> x) {
  rows_[0] = x[0] * x[0] * x[3] + std::sin(x[3] - x[4]) - 2 * std::numbers::sqrt2;
  rows_[1] = x[1] + std::pow(x[2], 4) * x[1] * x[1] - 8 - std::numbers::sqrt2;
}

// Excludes the noise.
void SampledBt6::differentiate(std::span<const double> x) {
  gradient_[0] = 2 * (x[0] - 1) + 2 * (x[0] - x[1]);
  gradient_[1] = -2 * (x[0] - x[1]);
  gradient_[2] = 2 * (x[2] - 1);
  gradient_[3] = 4 * std::pow(x[3] - 1, 3);
  gradient_[4] = 6 * std::pow(x[4] - 1, 5);
  const double slope = std::cos(x[3] - x[4]), cube = std::pow(x[2], 3);
  jacobian_.values = {2 * x[0] * x[3], 1 + 2 * cube * x[2] * x[1], 4 * cube * x[1] * x[1],
                      x[0] * x[0] + slope, -slope};
}

// The two rows have no variable in common: each y is determined separately.
double SampledBt6::true_kkt(std::span<const double> x) {
  evaluate_rows(x);
  differentiate(x);
  double along[2] = {}, squared[2] = {}, sum = 0.0;
  for (std::size_t j = 0; j < x.size(); ++j) {
    const Index row = jacobian_.row_indices[j];
    along[row] += gradient_[j] * jacobian_.values[j];
    squared[row] += jacobian_.values[j] * jacobian_.values[j];
  }
  for (std::size_t j = 0; j < x.size(); ++j) {
    const Index row = jacobian_.row_indices[j];
    const double slope = gradient_[j] - along[row] / squared[row] * jacobian_.values[j];
    sum += slope * slope;
  }
  return std::sqrt(sum + rows_[0] * rows_[0] + rows_[1] * rows_[1]);
}

namespace {

constexpr std::size_t kFirstSettled = 3;  // level; earlier ones are still far away

// Interpolates between two values: the mean of the middle two is the median of an even number.
double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  const double at = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (at - static_cast<double>(below)) * (values[above] - values[below]);
}

// One entry per seed.
struct Observed {
  std::vector<double> steps, lcqps, gradients, kkt;
};

}  // namespace

double LevelOfSeeds::scaled() const { return kkt * std::sqrt(static_cast<double>(samples)); }

Expected<std::vector<LevelOfSeeds>> levels_of_seeds(int seeds, int levels, nonlinear::LevelTest test,
                                                    const std::stop_token& stop) {
  std::vector<Observed> observed(static_cast<std::size_t>(levels));
  std::vector<LevelOfSeeds> made(observed.size());
  for (int seed = 0; seed < seeds; ++seed) {
    SampledBt6 bt6(static_cast<std::uint64_t>(seed));
    double steps = 0.0, lcqps = 0.0, gradients = 0.0;
    nonlinear::RetrospectiveSettings settings;
    settings.levels = levels, settings.test = test, settings.loop.stop = stop;
    settings.level = [&](const nonlinear::Level& level) {
      const auto k = static_cast<std::size_t>(level.level);
      steps += level.iterations, lcqps += level.ticks;
      gradients += static_cast<double>(level.linearisations) * static_cast<double>(level.samples);
      made[k].samples = level.samples;
      observed[k].steps.push_back(steps), observed[k].lcqps.push_back(lcqps);
      observed[k].gradients.push_back(gradients), observed[k].kkt.push_back(bt6.true_kkt(level.x));
    };
    MARBLE_ASSIGN_OR_RETURN(
        const auto answer,
        nonlinear::solve_retrospective(bt6.sampled(), nonlinear::open_ticks_in_process, settings));
    if (answer.answer.status == Status::cancelled)
      return unexpected(failure(ErrorCode::cancelled, "interrupted: there is no table"));
  }
  for (std::size_t k = 0; k < made.size(); ++k) {
    made[k].steps = quantile(observed[k].steps, 0.5), made[k].lcqps = quantile(observed[k].lcqps, 0.5);
    made[k].gradients = quantile(observed[k].gradients, 0.5);
    made[k].kkt = quantile(observed[k].kkt, 0.5);
    made[k].lower = quantile(observed[k].kkt, 0.25), made[k].upper = quantile(observed[k].kkt, 0.75);
  }
  return made;
}

TextTable levels_table(const std::vector<LevelOfSeeds>& levels) {
  TextTable table({"level", "samples", "steps", "LCQPs", "gradients/samples", "KKT", "lower quartile",
                   "upper quartile", "KKT*sqrt(samples)"});
  for (std::size_t k = 0; k < levels.size(); ++k) {
    const LevelOfSeeds& level = levels[k];
    table.add({std::to_string(k), std::to_string(level.samples), formatted("%.1f", level.steps),
               formatted("%.1f", level.lcqps),
               formatted("%.2f", level.gradients / static_cast<double>(level.samples)),
               formatted("%.2e", level.kkt), formatted("%.2e", level.lower), formatted("%.2e", level.upper),
               formatted("%.2f", level.scaled())});
  }
  return table;
}

std::string levels_summary(const std::vector<LevelOfSeeds>& levels, int seeds) {
  const LevelOfSeeds& last = levels.back();
  std::string text = "Median of " + std::to_string(seeds) + " seeds: ";
  if (levels.size() > kFirstSettled) {
    const auto [least, most] = std::minmax_element(
        levels.begin() + kFirstSettled, levels.end(),
        [](const LevelOfSeeds& one, const LevelOfSeeds& other) { return one.scaled() < other.scaled(); });
    text += "from level 3 on KKT*sqrt(samples) is between " + formatted("%.2f", least->scaled()) + " and " +
            formatted("%.2f", most->scaled()) + "; ";
  }
  return text + formatted("%.1f", last.steps) + " steps by " + formatted("%.1f", last.lcqps) +
         " LCQPs lead to " + formatted("%.1e", last.kkt) + " at " + std::to_string(last.samples) +
         " samples.\n";
}

std::string levels_csv(const std::vector<LevelOfSeeds>& levels) {
  std::string text = "samples,kkt,lower_quartile,upper_quartile\n";
  for (const LevelOfSeeds& level : levels)
    text += std::to_string(level.samples) + "," + gnuplot_number(level.kkt) + "," +
            gnuplot_number(level.lower) + "," + gnuplot_number(level.upper) + "\n";
  return text;
}

std::string levels_picture(const std::vector<LevelOfSeeds>& levels, PictureFormat format) {
  std::string text = gnuplot_style(format) + "$levels << END_OF_LEVELS\n";
  for (const LevelOfSeeds& level : levels)
    text += std::to_string(level.samples) + " " + gnuplot_number(level.kkt) + " " +
            gnuplot_number(level.lower) + " " + gnuplot_number(level.upper) + "\n";
  return text +
         "END_OF_LEVELS\nset title 'Retrospective approximation of BT6' noenhanced\n"
         "set logscale xy 10\nset format '10^{%T}'\nset xlabel 'samples'\n"
         "set ylabel 'KKT error of the problem without noise'\n"
         "plot $levels using 1:3:4 with filledcurves linecolor " +
         gnuplot_colour(0) + " fillstyle transparent solid 0.2 noborder title 'quartiles', \\\n" +
         "  $levels using 1:2 with linespoints pointtype 7 linewidth 2 linecolor " + gnuplot_colour(0) +
         " title 'median', \\\n  2/sqrt(x) linewidth 2 dashtype 2 linecolor " + gnuplot_colour(1) +
         " title '2 / sqrt(samples)'\n";
}

}  // namespace marble::cli
