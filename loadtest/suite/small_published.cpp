// Provides small problems from the literature with their published optima; none is among the 39 benchmarks.
#include <utility>

#include "hard_families.h"
#include "model.h"

namespace marble::suite {
namespace {

using examples::Model;
using examples::Terms;

struct Row {
  Terms terms;
  double constant;
};

// The leader, whose variables come first, minimizes `cost`; the follower minimizes `own` over its variables
// with rows ≥ 0. The follower's optimality: own = Σ λ_i of its part of row i, λ_i ⊥ row i.
OwnedProblem leader_and_follower(Index leaders, const std::vector<double>& cost,
                                 const std::vector<double>& own, const std::vector<Row>& rows,
                                 const std::vector<Row>& of_leader = {}) {
  const auto variables = static_cast<Index>(cost.size());
  Model model("leader and follower", variables + static_cast<Index>(rows.size()));
  for (Index j = 0; j < variables; ++j) model.add_linear(cost[static_cast<std::size_t>(j)], j);
  for (const Row& row : of_leader) model.at_least_zero(row.terms, row.constant);
  std::vector<Terms> stationarity(own.size());
  Index multiplier = variables;
  for (const Row& row : rows) {
    model.complementary(row.terms, row.constant, {{multiplier, 1.0}}, 0.0);
    for (const auto& [variable, factor] : row.terms) {
      if (variable >= leaders)
        stationarity[static_cast<std::size_t>(variable - leaders)].push_back({multiplier, -factor});
    }
    ++multiplier;
  }
  for (std::size_t i = 0; i < own.size(); ++i) model.equal_zero(stationarity[i], own[i]);
  return model.problem();
}

Row row(Terms terms, double constant) { return {std::move(terms), constant}; }

// Rows of Bialas and Karwan 1984, in x and y.
std::vector<Row> five_rows() {
  return {row({{0, 1.0}, {1, 2.0}}, -10.0), row({{0, -1.0}, {1, 2.0}}, 6.0), row({{0, -2.0}, {1, 1.0}}, 21.0),
          row({{0, -1.0}, {1, -2.0}}, 38.0), row({{0, 1.0}, {1, -2.0}}, 18.0)};
}

// min x² + y² + 2 factor xy with 0 ≤ x ⊥ y ≥ 0.
OwnedProblem product(double factor) {
  Model model("ralph2", 2);
  model.add_square(2.0 - 2.0 * factor, {{0, 1.0}});
  model.add_square(2.0 - 2.0 * factor, {{1, 1.0}});
  model.add_square(2.0 * factor, {{0, 1.0}, {1, 1.0}});
  model.complementary({{0, 1.0}}, 0.0, {{1, 1.0}}, 0.0);
  return model.problem();
}

}  // namespace

void add_published(std::vector<HardProblem>& all) {
  const auto add = [&](OwnedProblem problem, double optimum) {
    all.push_back({"published", std::move(problem), {}, optimum});
  };
  // Anandalingam and White, "A solution method for the linear static Stackelberg problem using penalty
  // functions", 1990: (16, 11); at (0, 5) is a local optimum of −15.
  const Row x_positive = row({{0, 1.0}}, 0.0);
  const Row y_positive = row({{1, 1.0}}, 0.0);
  std::vector<Row> rows = five_rows();
  rows.push_back(y_positive);
  add(leader_and_follower(1, {-1.0, -3.0}, {1.0}, rows, {x_positive}), -49.0);
  // Bialas and Karwan, "Two-level linear programming", 1984: (16, 11).
  add(leader_and_follower(1, {0.0, -1.0}, {1.0}, rows, {x_positive}), -11.0);
  // Candler and Townsley, "A linear two-level programming problem", 1982: x = (0, .9), y = (0, .6, .4).
  rows = {row({{2, 1.0}, {3, -1.0}, {4, -1.0}}, 1.0), row({{0, -2.0}, {2, 1.0}, {3, -2.0}, {4, 0.5}}, 1.0),
          row({{1, -2.0}, {2, -2.0}, {3, 1.0}, {4, 0.5}}, 1.0)};
  for (const Index j : {2, 3, 4}) rows.push_back(row({{j, 1.0}}, 0.0));
  add(leader_and_follower(2, {-8.0, -4.0, 4.0, -40.0, -4.0}, {1.0, 1.0, 2.0}, rows, {x_positive, y_positive}),
      -29.2);
  // Bard and Falk, "An explicit solution to the multi-level programming problem", 1982: x = (2, 0),
  // y = (1.5, 0).
  rows = {row({{0, 2.0}, {2, -1.0}, {3, 1.0}}, -2.5), row({{0, -1.0}, {1, 3.0}, {3, -1.0}}, 2.0),
          row({{0, -1.0}, {1, -1.0}}, 2.0)};
  for (const Index j : {2, 3}) rows.push_back(row({{j, 1.0}}, 0.0));
  add(leader_and_follower(2, {-2.0, 1.0, 0.5, 0.0}, {-4.0, 1.0}, rows, {x_positive, y_positive}), -3.25);
  // Of MacMPEC: kth1, ralph1 (no multiplier makes 0 strongly stationary), ralph2 (Q is not convex).
  Model kth1("kth1", 2);
  kth1.add_linear(1.0, 0);
  kth1.add_linear(1.0, 1);
  kth1.complementary({{0, 1.0}}, 0.0, {{1, 1.0}}, 0.0);
  add(kth1.problem(), 0.0);
  Model ralph1("ralph1", 2);
  ralph1.add_linear(2.0, 0);
  ralph1.add_linear(-1.0, 1);
  ralph1.at_least_zero({{0, 1.0}});
  ralph1.complementary({{1, 1.0}}, 0.0, {{0, -1.0}, {1, 1.0}}, 0.0);
  add(ralph1.problem(), 0.0);
  add(product(-2.0), 0.0);
}

}  // namespace marble::suite
