#include "research/retrospective_levels.h"

#include <algorithm>
#include <cmath>

#include "research/sampled_bt6.h"

namespace marble::cli {
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
    const auto answer =
        nonlinear::solve_retrospective(bt6.sampled(), nonlinear::open_ticks_in_process, settings);
    if (!answer) return unexpected(answer.error());
    if (answer->answer.status == Status::cancelled)
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
