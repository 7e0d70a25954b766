#include <algorithm>
#include <array>
#include <cmath>

#include "marble/composite/counter_random.h"
#include "marble/research/methods.h"
#include "research/reproductions.h"

namespace marble::cli {
namespace {

struct Contender {
  Method method;
  const char* name;    // as in option method
  const char* stands;  // its counterpart in the paper
};
constexpr std::array kMethods = {Contender{Method::aladin_beta, "aladin_beta", "ALADIN-beta"},
                                 Contender{Method::l1_barrier_stepwise, "l1_barrier_stepwise", "IPOPT1"},
                                 Contender{Method::l1_barrier, "l1_barrier", "IPOPT2"},
                                 Contender{Method::plain_barrier, "plain_barrier", "IPOPT-vanilla"}};
constexpr int kIterations = 100, kPairs = 10;
constexpr double kError = 1e-10, kProduct = 1e-16;  // the paper's values for figure 2

const char* name_of(AladinStart start) {
  return start == AladinStart::path ? "(1, 1)" : start == AladinStart::near ? "near 1" : "in [0, 2]";
}

std::vector<double> first_point(AladinStart start, std::uint64_t seed) {
  if (start == AladinStart::path) return {1.0, 1.0};
  const CounterRandom random(seed);
  std::vector<double> z(2 * kPairs);
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double u = random.uniform(i);
    z[i] = start == AladinStart::near ? 0.98 + 0.04 * u : 2.0 * u;
  }
  return z;
}

class Way final : public ProgressSink {
 public:
  explicit Way(AladinRun& run) : run_(run) {}

  void report(const Progress& row) override {
    const std::size_t pairs = row.s.size();
    double square = 0.0, product = 0.0;
    for (std::size_t i = 0; i < pairs; ++i) {
      const double s = row.s[i], t = row.t[i];
      square += std::min((s - 1.0) * (s - 1.0) + t * t, s * s + (t - 1.0) * (t - 1.0));
      product = std::max(product, std::abs(s * t));
    }
    run_.s.push_back(row.s.front());
    run_.t.push_back(row.t.front());
    run_.error.push_back(std::sqrt(square));
    run_.complementarity.push_back(product);
    // μ of ALADIN-β falls from the first iteration on: otherwise another method took over with its own μ.
    const bool begins = row.kappa > kappa_ || (row.kappa == kappa_ && row.iteration == 1);
    if (run_.method == Method::aladin_beta && begins && run_.fell_back < 0)
      run_.fell_back = row.iteration - 1;
    kappa_ = row.kappa;
  }
  [[nodiscard]] bool wants_pairs() const override { return true; }

 private:
  AladinRun& run_;
  double kappa_ = std::numeric_limits<double>::infinity();
};

// No tolerance ends the run: the result is how far it converges.
Expected<AladinRun> run_once(AladinStart start, Method method, std::uint64_t seed,
                             const std::stop_token& stop) {
  AladinRun run{start, method, seed, {}, {}, {}, {}, -1, 0};
  const std::vector<double> z = first_point(start, seed);
  Options options;
  options.method = method;
  options.max_iterations = kIterations;
  options.scaling_passes = 0;
  options.equality_tolerance = options.inequality_tolerance = options.complementarity_tolerance =
      options.stationarity_tolerance = 1e-14;
  Way way(run);
  MARBLE_ASSIGN_OR_RETURN(const auto answer, research::solve_in_process(
                                                 aladin_example(static_cast<int>(z.size() / 2)).view(),
                                                 options, {.progress = &way, .stop = stop, .initial_z = z}));
  if (answer.status == Status::cancelled)
    return unexpected(failure(ErrorCode::cancelled, "interrupted: there is no table"));
  run.factorizations = answer.factorizations;
  return run;
}

std::string at(int iteration) { return iteration < 0 ? "-" : std::to_string(iteration); }

}  // namespace

OwnedProblem aladin_example(int pairs) {
  OwnedProblem p;
  p.name = "ALADIN-beta (18)";
  const Index n = 2 * pairs;
  const auto unit = [n](Index rows, Index first, const char* name) {
    std::vector<Index> row(static_cast<std::size_t>(rows)), column(row.size());
    for (Index i = 0; i < rows; ++i) {
      row[static_cast<std::size_t>(i)] = i;
      column[static_cast<std::size_t>(i)] = first + i;
    }
    return compress(rows, n, {row, column, std::vector<double>(row.size(), 1.0)}, name).value();
  };
  p.Q = unit(n, 0, "Q");
  p.g.assign(static_cast<std::size_t>(n), -1.0);
  p.c0 = pairs;
  p.L = unit(pairs, 0, "L");
  p.R = unit(pairs, pairs, "R");
  p.l.assign(static_cast<std::size_t>(pairs), 0.0);
  p.r = p.l;
  return p;
}

int AladinRun::settled(const std::vector<double>& values, double most) {
  const auto last = std::find_if(values.rbegin(), values.rend(), [most](double v) { return !(v <= most); });
  const auto first = static_cast<int>(values.rend() - last);
  return first < static_cast<int>(values.size()) ? first : -1;
}

Expected<std::vector<AladinRun>> aladin_runs(int seeds, const std::stop_token& stop) {
  std::vector<AladinRun> runs;
  for (const AladinStart start : {AladinStart::path, AladinStart::near, AladinStart::far}) {
    for (const auto& [method, name, stands] : kMethods) {
      for (int seed = 0; seed < (start == AladinStart::path ? 1 : seeds); ++seed) {
        MARBLE_ASSIGN_OR_RETURN(auto run, run_once(start, method, static_cast<std::uint64_t>(seed), stop));
        runs.push_back(std::move(run));
      }
    }
  }
  return runs;
}

TextTable aladin_table(const std::vector<AladinRun>& runs) {
  TextTable table({"start", "method", "stands for", "seeds", "come to 1e-10", "fall back", "error 1e-6 from",
                   "1e-8 from", "1e-10 from", "products 1e-16 from", "worst end", "factorizations"});
  for (const AladinStart start : {AladinStart::path, AladinStart::near, AladinStart::far}) {
    for (const auto& [method, name, stands] : kMethods) {
      int seeds = 0, come = 0, back = 0, factorizations = 0;
      double end = 0.0;
      std::array<int, 4> worst = {0, 0, 0, 0};
      for (const AladinRun& run : runs) {
        if (run.start != start || run.method != method) continue;
        ++seeds;
        back += run.fell_back >= 0;
        factorizations += run.factorizations;
        end = std::max(end, run.error.back());
        if (AladinRun::settled(run.error, kError) < 0) continue;
        ++come;
        const int settled[] = {AladinRun::settled(run.error, 1e-6), AladinRun::settled(run.error, 1e-8),
                               AladinRun::settled(run.error, kError),
                               AladinRun::settled(run.complementarity, kProduct)};
        for (std::size_t k = 0; k < worst.size(); ++k)
          worst[k] = worst[k] < 0 || settled[k] < 0 ? -1 : std::max(worst[k], settled[k]);
      }
      if (seeds == 0) continue;
      if (come == 0) worst.fill(-1);
      table.add({name_of(start), name, stands, std::to_string(seeds), std::to_string(come),
                 std::to_string(back), at(worst[0]), at(worst[1]), at(worst[2]), at(worst[3]),
                 formatted("%.1e", end), formatted("%.0f", static_cast<double>(factorizations) / seeds)});
    }
  }
  return table;
}

std::string aladin_csv(const std::vector<AladinRun>& runs) {
  std::string text = "start,method,seed,fell_back,iteration,s,t,error,complementarity\n";
  for (const AladinRun& run : runs) {
    const char* method = std::ranges::find(kMethods, run.method, &Contender::method)->name;
    const char* start = run.start == AladinStart::path   ? "path"
                        : run.start == AladinStart::near ? "near"
                                                         : "far";
    for (std::size_t k = 0; k < run.error.size(); ++k) {
      text += std::string(start) + "," + method + "," + std::to_string(run.seed) + "," +
              std::to_string(run.fell_back) + "," + std::to_string(k);
      for (const double value : {run.s[k], run.t[k], run.error[k], run.complementarity[k]})
        text += "," + gnuplot_number(value);
      text += "\n";
    }
  }
  return text;
}

std::string aladin_picture(const std::vector<AladinRun>& runs, PictureFormat format) {
  std::string text = gnuplot_style(format);
  std::array<std::string, 3> plots;
  for (std::size_t k = 0; k < kMethods.size(); ++k) {
    for (const AladinRun& run : runs) {
      if (run.method != kMethods[k].method || run.seed != 0 || run.start == AladinStart::far) continue;
      const bool path = run.start == AladinStart::path;
      const std::string data = (path ? "$path" : "$ways") + std::to_string(k);
      text += data + " << END_OF_RUN\n";
      for (std::size_t i = 0; i < run.error.size(); ++i) {
        text += std::to_string(i);  // of zeros, which a logarithmic axis cannot show, the last is drawn

        for (const double value :
             {run.s[i], run.t[i], std::max(run.error[i], 1e-17), std::max(run.complementarity[i], 1e-22)})
          text += " " + gnuplot_number(value);
        text += "\n";
      }
      text += "END_OF_RUN\n";
      const std::string look = " with linespoints pointtype 7 pointsize 0.5 linewidth 2 linecolor " +
                               gnuplot_colour(k) + " title '" + kMethods[k].stands + "'";
      const auto add = [&](std::string& plot, const char* columns) {
        plot += (plot.empty() ? "plot " : ", \\\n  ") + data + " using " + columns + look;
      };
      if (path) {
        add(plots[0], "2:3");
      } else {
        add(plots[1], "1:4");
        add(plots[2], "1:5");
      }
    }
  }
  return text +
         "set multiplot layout 2,2 columnsfirst\nset format y '%g'\n"
         "set title 'n = 1, from (1, 1)' noenhanced\nset xlabel 's'\nset ylabel 't'\n" +
         plots[0] +
         "\nset title 'n = 1: the same, ALADIN-beta alone' noenhanced\n"
         "plot $path0 using 2:3:1 with labels offset 1,0.5 notitle, \\\n"
         "  $path0 using 2:3 with linespoints pointtype 7 pointsize 0.5 linewidth 2 linecolor " +
         gnuplot_colour(0) +
         " title 'by iteration'\n"
         "set logscale y 10\nset format y '10^{%T}'\nset xlabel 'iteration'\n"
         "set title 'n = 10: distance to the nearest local minimum' noenhanced\nset ylabel 'error'\n" +
         plots[1] + "\nset title 'n = 10: largest product' noenhanced\nset ylabel '|s t|'\n" + plots[2] +
         "\nunset multiplot\n";
}

}  // namespace marble::cli
