#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "families.h"
#include "peers.h"
#include "quadratic_families.h"
#include "record.h"
#include "support/small_problems.h"

namespace marble::suite {
namespace {

constexpr int kTurns = 3, kMostTurns = 30;  // of each solver; the fastest is used
constexpr double kTurns_ms = 200.0;         // as many as fit, within these bounds

std::vector<OwnedProblem> problems() {
  std::vector<OwnedProblem> all;
  const auto add = [&all](const std::string& name, OwnedProblem p) {
    p.name = name;
    all.push_back(std::move(p));
  };
  std::uint64_t seed = 1;
  for (const Index n : {50, 100, 200, 500, 1000, 2000}) {
    add("singular-" + std::to_string(n), scattered_problem(n, Curvature::singular, seed++));
    add("strict-" + std::to_string(n), scattered_problem(n, Curvature::strict, seed++));
    add("diagonal-" + std::to_string(n), scattered_problem(n, Curvature::diagonal, seed++));
  }
  for (const Index steps : {10, 30, 100, 300, 667})
    add("mpc-" + std::to_string(6 * steps), mpc_problem(steps, seed++));
  for (const Index n : {100, 1000, 20000}) add("obstacle-" + std::to_string(n), testing::obstacle_problem(n));
  return all;
}

struct Peer {
  std::string name;
  double milliseconds, objective, violation;
};

// Returns the script's results for a problem; nothing if it cannot be run.
std::vector<Peer> ask_peers(const std::string& script, const OwnedProblem& p, const std::string& file,
                            int turns) {
  write_json(p, file);
  std::vector<Peer> peers;
  const std::string command = script + " " + file + " " + std::to_string(turns);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> said(popen(command.c_str(), "r"), pclose);
  char name[32];
  Peer peer;
  while (said && std::fscanf(said.get(), "%31s %lf %lf %lf", name, &peer.milliseconds, &peer.objective,
                             &peer.violation) == 4) {
    peer.name = name;
    peer.milliseconds *= 1e3;
    peers.push_back(peer);
  }
  return peers;
}

}  // namespace

void qp(const Settings& settings) {
  const std::string file = std::filesystem::temp_directory_path() / ("marble-qp-" + std::to_string(getpid()));
  std::printf("%-16s %6s %9s %9s", "problem", "fact.", "violation", "ms");
  std::printf("%s\n", settings.peers.empty() ? "" : "  peers: ms, objective above ours, violation");
  std::vector<double> ratios;
  for (const OwnedProblem& p : problems()) {
    if (!settings.only.empty() && p.name != settings.only) continue;
    Record own = solve_and_judge(p.name, p, {}, std::nan(""));
    const int turns = std::clamp(static_cast<int>(kTurns_ms / own.milliseconds), kTurns, kMostTurns);
    for (int turn = 1; turn < turns; ++turn)
      own.milliseconds = std::min(own.milliseconds, solve_and_judge(p.name, p, {}, 0.0).milliseconds);
    std::printf("%-16s %6d %9.1e %9.3f%s", p.name.c_str(), own.factorizations, own.violation,
                own.milliseconds, own.feasible() ? "" : "  not solved");
    double fastest = std::numeric_limits<double>::infinity();
    if (!settings.peers.empty()) {
      for (const Peer& peer : ask_peers(settings.peers, p, file, turns)) {
        std::printf("  %s %.3f %+.1e %.1e", peer.name.c_str(), peer.milliseconds,
                    (peer.objective - own.objective) / std::max(1.0, std::abs(own.objective)),
                    peer.violation);
        const bool solved =
            std::abs(peer.objective - own.objective) <= 1e-4 * std::max(1.0, std::abs(own.objective));
        if (solved) fastest = std::min(fastest, peer.milliseconds);
      }
    }
    if (std::isfinite(fastest))
      ratios.push_back(own.milliseconds / fastest), std::printf("  %.2f ×", ratios.back());
    std::printf("\n");
    std::fflush(stdout);
  }
  std::filesystem::remove(file);
  if (ratios.empty()) return;
  double logs = 0.0;
  for (const double ratio : ratios) logs += std::log(ratio);
  std::printf("qp: time over the fastest peer's: geometric mean %.2f, worst %.2f\n\n",
              std::exp(logs / static_cast<double>(ratios.size())), *std::ranges::max_element(ratios));
}

}  // namespace marble::suite
