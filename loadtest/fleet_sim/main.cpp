// fleet_sim: simulates one plan of a fleet and prints one line of JSON.
#include <CLI/CLI.hpp>
#include <cmath>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <random>

#include "simulation.h"

namespace {

using namespace marble::fleet_sim;

std::vector<double> read_times(const std::string& path) {
  std::vector<double> times;
  std::ifstream file(path);
  for (double value = 0.0; file >> value;) times.push_back(value);
  return times;
}

std::vector<Recorded> read_jobs(const std::string& path) {
  std::vector<Recorded> jobs;
  std::ifstream file(path);
  for (Recorded job; file >> job.arrival_s >> job.service_s;) jobs.push_back(job);
  return jobs;
}

// Enough quantiles for a mean and a tail.
std::vector<double> lognormal_times(double mean_s, double variation) {
  const double sigma = std::sqrt(std::log1p(variation * variation));
  std::mt19937_64 random(7);
  std::lognormal_distribution<double> distribution(std::log(mean_s) - sigma * sigma / 2.0, sigma);
  std::vector<double> times(100'000);
  for (double& time : times) time = distribution(random);
  return times;
}

double mean(const std::vector<double>& values) {
  return values.empty()
             ? 0.0
             : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

nlohmann::json to_json(const Plan& plan, const Outcome& outcome) {
  const auto ms = [](const std::vector<double>& values, double share) {
    return 1e3 * quantile(values, share);
  };
  const double solves = static_cast<double>(outcome.total_s.size());
  return {{"planners", plan.planners},
          {"servers", plan.servers},
          {"workers", plan.workers},
          {"balance", balance_names()[static_cast<std::size_t>(plan.balance)]},
          {"sessions", plan.sessions},
          {"service_ms", 1e3 * mean(plan.service_s)},
          {"ticks", outcome.ticks},
          {"solves_per_s", solves / plan.run_s},
          {"busy", outcome.busy},
          {"missed", outcome.missed()},
          {"late", outcome.late},
          {"superseded", outcome.superseded},
          {"wait_mean_ms", 1e3 * mean(outcome.wait_s)},
          {"wait_p50_ms", ms(outcome.wait_s, 0.5)},
          {"wait_p99_ms", ms(outcome.wait_s, 0.99)},
          {"total_p50_ms", ms(outcome.total_s, 0.5)},
          {"total_p99_ms", ms(outcome.total_s, 0.99)},
          {"total_p999_ms", ms(outcome.total_s, 0.999)},
          {"servers_at_end", outcome.servers_at_end},
          {"served_by_first", outcome.served.front()},
          {"served_by_last", outcome.served.back()}};
}

}  // namespace

int main(int argc, char** argv) {
  Plan plan;
  std::string times, recorded, balance = "least";
  double mean_ms = 10.0, variation = 0.5, deadline_ms = 50.0, network_ms = 0.2, overhead_ms = 0.0;
  CLI::App app("Simulates planners, a balancer and Marble servers; prints one line of JSON.", "fleet_sim");
  app.add_option("--planners", plan.planners)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--rate", plan.rate_hz, "ticks a second of each; 0: the next when the last is answered")
      ->capture_default_str();
  app.add_flag("--sessions", plan.sessions, "planners keep to a server");
  app.add_option("--servers", plan.servers)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--workers", plan.workers)->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--balance", balance)->check(CLI::IsMember(balance_names()))->capture_default_str();
  app.add_option("--deadline-ms", deadline_ms, "0: none")->capture_default_str();
  app.add_option("--network-ms", network_ms, "one way")->capture_default_str();
  app.add_option("--overhead-ms", overhead_ms, "of a solve on its worker")->capture_default_str();
  app.add_option("--times", times, "file of times of solves, seconds, one a line")->check(CLI::ExistingFile);
  app.add_option("--recorded", recorded,
                 "file of jobs of one server: arrival and time of solve, seconds, one job a line")
      ->check(CLI::ExistingFile);
  app.add_option("--mean-ms", mean_ms, "else lognormal times of this mean")->capture_default_str();
  app.add_option("--variation", variation, "and this standard deviation, as a share of the mean")
      ->capture_default_str();
  app.add_option("--slow-factor", plan.slow_factor, "how much slower the first server is")
      ->capture_default_str();
  app.add_option("--warm-s", plan.warm_s, "not counted")->capture_default_str();
  app.add_option("--run-s", plan.run_s)->capture_default_str();
  app.add_option("--ramp-from", plan.ramp_from, "share of the planners that is there at first")
      ->capture_default_str();
  app.add_option("--ramp-s", plan.ramp_s, "time in which the others come")->capture_default_str();
  app.add_option("--poll-s", plan.autoscaler.poll_s, "the autoscaler's; 0: none")->capture_default_str();
  app.add_option("--window-s", plan.autoscaler.window_s, "over which it averages")->capture_default_str();
  app.add_option("--start-s", plan.autoscaler.start_s, "until a new server takes work")
      ->capture_default_str();
  app.add_option("--target", plan.autoscaler.target, "busy workers of a server")->capture_default_str();
  app.add_option("--seed", plan.seed)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  plan.deadline_s = deadline_ms / 1e3;
  plan.network_s = network_ms / 1e3;
  plan.overhead_s = overhead_ms / 1e3;
  const auto& names = balance_names();
  plan.balance = static_cast<Balance>(std::find(names.begin(), names.end(), balance) - names.begin());
  plan.service_s = times.empty() ? lognormal_times(mean_ms / 1e3, variation) : read_times(times);
  if (!recorded.empty()) {
    plan.recorded = read_jobs(recorded);
    plan.rate_hz = 0.0;
  }
  if (plan.service_s.empty()) {
    std::cerr << times << ": no times\n";
    return 2;
  }
  std::cout << to_json(plan, simulate(plan)).dump() << '\n';
  return 0;
}
