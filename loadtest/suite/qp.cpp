#include "qp.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "noise.h"
#include "peers.h"
#include "record.h"
#include "support/problems/small_problems.h"

namespace marble::suite {
namespace {

constexpr int kTurns = 3, kMostTurns = 30;  // of each solver; the fastest counts
constexpr double kTurns_ms = 200.0;         // as many as fit, in between

enum class Curvature { singular, strict, diagonal };

SparseMatrix matrix(Index rows, Index columns, const Triplets& entries, const char* name) {
  return compress(rows, columns, entries, name).value();
}

// Four entries in each row, at random.
Triplets scattered(Index rows, Index columns, Noise& noise) {
  Triplets entries;
  for (Index row = 0; row < rows; ++row) {
    for (int k = 0; k < 4; ++k) {
      const auto column = static_cast<Index>(0.5 * (noise.uniform() + 1.0) * columns);
      entries.add(row, std::min(column, columns - 1), noise.uniform());
    }
  }
  return entries;
}

std::vector<double> image(Index rows, const Triplets& entries, const std::vector<double>& z) {
  std::vector<double> value(static_cast<std::size_t>(rows));
  for (std::size_t k = 0; k < entries.values.size(); ++k)
    value[entries.rows[k]] += entries.values[k] * z[entries.columns[k]];
  return value;
}

// n/5 equalities, n inequalities of which half hold with equality at a point within the box |z| ≤ 2.
OwnedProblem scattered_problem(Index n, Curvature curvature, std::uint64_t seed) {
  Noise noise(seed);
  OwnedProblem p;
  Triplets Q;
  if (curvature != Curvature::diagonal) {
    const Triplets root = scattered(n / 2, n, noise);  // four entries a row
    for (std::size_t first = 0; first < root.values.size(); first += 4) {
      for (std::size_t i = first; i < first + 4; ++i) {
        for (std::size_t j = first; j < first + 4; ++j)
          Q.add(root.columns[i], root.columns[j], root.values[i] * root.values[j]);
      }
    }
  }
  for (Index j = 0; curvature != Curvature::singular && j < n; ++j) Q.add(j, j, 0.6 + 0.5 * noise.uniform());
  p.Q = matrix(n, n, Q, "Q");
  std::vector<double> point(static_cast<std::size_t>(n));
  for (double& entry : point) entry = noise.uniform();
  for (Index j = 0; j < n; ++j) p.g.push_back(noise.uniform());
  const Triplets A = scattered(n / 5, n, noise);
  p.A = matrix(n / 5, n, A, "A");
  p.b = image(n / 5, A, point);
  for (double& entry : p.b) entry = -entry;
  Triplets C = scattered(n, n, noise);
  p.d = image(n, C, point);
  for (double& entry : p.d) entry = std::max(0.0, noise.uniform()) - entry;
  for (Index j = 0; j < n; ++j) {
    C.add(n + 2 * j, j, 1.0);
    C.add(n + 2 * j + 1, j, -1.0);
    p.d.insert(p.d.end(), {2.0, 2.0});
  }
  p.C = matrix(3 * n, n, C, "C");
  return p;
}

// A mass in the plane, 4 states and 2 forces a step, to the origin from afar: forces and speeds are bounded.
OwnedProblem mpc_problem(Index steps, std::uint64_t seed) {
  constexpr double kStep_s = 0.1;
  Noise noise(seed);
  OwnedProblem p;
  Triplets Q, A, C;
  const Index n = 6 * steps;
  const auto at = [](Index step, Index which) { return 6 * step + which; };  // x y vx vy fx fy
  std::array<double, 4> state = {8.0 + 4.0 * noise.uniform(), 5.0 * noise.uniform(), noise.uniform(),
                                 noise.uniform()};
  for (Index step = 0; step < steps; ++step) {
    for (Index i = 0; i < 6; ++i) Q.add(at(step, i), at(step, i), i < 2 ? 1.0 : 0.1);
    for (Index i = 0; i < 4; ++i) {  // next state − its prediction = 0
      const Index row = 4 * step + i;
      A.add(row, at(step, i), 1.0);
      A.add(row, at(step, 4 + i % 2), i < 2 ? -0.5 * kStep_s * kStep_s : -kStep_s);
      if (step > 0) A.add(row, at(step - 1, i), -1.0);
      if (step > 0 && i < 2) A.add(row, at(step - 1, i + 2), -kStep_s);
      p.b.push_back(step > 0 ? 0.0 : -state[i] - (i < 2 ? kStep_s * state[i + 2] : 0.0));
    }
    for (Index i = 2; i < 6; ++i) {
      for (const double sign : {1.0, -1.0}) {
        C.add(static_cast<Index>(p.d.size()), at(step, i), sign);
        p.d.push_back(i < 4 ? 2.5 : 1.0 + 0.5 * (i - 4));
      }
    }
  }
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  p.Q = matrix(n, n, Q, "Q");
  p.A = matrix(4 * steps, n, A, "A");
  p.C = matrix(8 * steps, n, C, "C");
  return p;
}

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

// What the script says of a problem; nothing if it cannot be run.
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
