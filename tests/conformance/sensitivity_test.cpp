// Derivatives asked for with a solve: the same bits here and there, by every call that solves.
#include "marble/sensitivity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <random>

#include "marble/client.h"
#include "marble/examples.h"
#include "support/server_process.h"

namespace marble::testing {
namespace {

using Values = std::vector<double>;

constexpr int kAskedSteps = 12;

Values values_by_seed(std::size_t size, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  Values values(size);
  for (double& value : values) value = static_cast<double>(engine() >> 11) * 0x1p-52 - 1.0;
  return values;
}

/// A request of every kind, with what it borrows.
struct Asked {
  explicit Asked(const OwnedProblem& p, Index m = 3)
      : n(p.g.size()),
        proximal(p.g.size(), 0.0),
        g(p.g),
        b(values_by_seed(2 * p.b.size(), 1)),
        R(values_by_seed(2 * p.R.values.size(), 2)),
        z(values_by_seed(2 * p.g.size(), 3)),
        xi(values_by_seed(2 * p.l.size(), 4)) {
    // The first loss weighs early stages of z alone: later ones have forces that nothing prices.
    std::fill_n(xi.begin(), p.l.size(), 0.0);
    std::fill(z.begin() + static_cast<std::ptrdiff_t>(n / 8), z.begin() + static_cast<std::ptrdiff_t>(n),
              0.0);
    Triplets entries;
    for (Index i = 0; i < m; ++i) entries.add(i, i, 1.0), entries.add(i, static_cast<Index>(n) - 1 - i, -0.5);
    E = compress(m, static_cast<Index>(n), entries, "E").value();
    request.rows = RowsRequest{.E = E.view(), .proximal = proximal, .g = g, .columns = true};
    request.directions = {2, {.b = b, .R = R}};
    request.losses = {2, {.z = z, .complementarity_multipliers_L = xi}};
  }
  Asked(const Asked&) = delete;
  Asked& operator=(const Asked&) = delete;

  std::size_t n;
  SparseMatrix E;
  Values proximal, g, b, R, z, xi;
  SensitivityRequest request;
};

// NaN too, of what has no derivative.
void expect_bits(const Values& a, const Values& b, const char* what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(double)), 0) << what;
}

void expect_same_derivatives(const Solution& a, const Solution& b) {
  ASSERT_TRUE(a.sensitivity.has_value() && b.sensitivity.has_value());
  ASSERT_TRUE(a.sensitivity->has_value()) << a.sensitivity->error().message();
  ASSERT_TRUE(b.sensitivity->has_value()) << b.sensitivity->error().message();
  const SensitivityAnswer &here = **a.sensitivity, &there = **b.sensitivity;
  EXPECT_EQ(here.weak_inequalities, there.weak_inequalities);
  EXPECT_EQ(here.biactive_pairs, there.biactive_pairs);
  EXPECT_EQ(here.factorizations, there.factorizations);
  EXPECT_EQ(here.back_substitutions, there.back_substitutions);
  EXPECT_EQ(a.factorizations, b.factorizations);
  ASSERT_TRUE(here.rows.has_value() && there.rows.has_value());
  ASSERT_TRUE(here.rows->has_value()) << here.rows->error().message();
  ASSERT_TRUE(there.rows->has_value()) << there.rows->error().message();
  EXPECT_EQ((*here.rows)->values, (*there.rows)->values);
  EXPECT_EQ((*here.rows)->free, (*there.rows)->free);
  EXPECT_EQ((*here.rows)->response, (*there.rows)->response);
  EXPECT_EQ((*here.rows)->z, (*there.rows)->z);
  EXPECT_EQ((*here.rows)->columns, (*there.rows)->columns);
  expect_bits(here.changes.z, there.changes.z, "changes.z");
  expect_bits(here.changes.equality_multipliers, there.changes.equality_multipliers,
              "changes.equality_multipliers");
  expect_bits(here.changes.complementarity_multipliers_R, there.changes.complementarity_multipliers_R,
              "changes.complementarity_multipliers_R");
  EXPECT_EQ(here.changes.active_set_constant, there.changes.active_set_constant);
  EXPECT_EQ(here.changes.undefined, there.changes.undefined);
  expect_bits(here.gradients.g, there.gradients.g, "gradients.g");
  expect_bits(here.gradients.b, there.gradients.b, "gradients.b");
  expect_bits(here.gradients.Q, there.gradients.Q, "gradients.Q");
  expect_bits(here.gradients.R, there.gradients.R, "gradients.R");
  EXPECT_EQ(here.gradients.undefined, there.gradients.undefined);
  EXPECT_FALSE(std::isnan(here.gradients.g.front())) << "the first loss has a gradient";
}

class SensitivityThere : public ::testing::Test {
 protected:
  ServerProcess server_{MARBLE_SERVER_BINARY, {"--sensitivity-rows", "5", "--sensitivity-directions", "4"}};
  const Client here_ = Client::in_process();
  const Client there_ = Client::connect(server_.address()).value();
  const OwnedProblem problem_ = examples::hopper({.steps = kAskedSteps});
  const Asked asked_{problem_};
};

TEST_F(SensitivityThere, EveryCallThatSolvesReportsTheBitsOfASolveHere) {
  const SolveControls controls{.sensitivity = &asked_.request};
  const Solution here = solve_in_process(problem_.view(), {}, controls).value();
  for (const Client* client : {&here_, &there_}) {
    SCOPED_TRACE(client->address());
    const auto solved = client->solve(problem_.view(), {}, controls);
    ASSERT_TRUE(solved.has_value()) << solved.error().message();
    expect_same_derivatives(here, *solved);
    auto pending = client->solve_async(problem_.view(), {}, controls);
    ASSERT_TRUE(pending.has_value()) << pending.error().message();
    expect_same_derivatives(here, pending->get().value());
    const BatchProblem item{.tag = 1, .problem = problem_.view(), .sensitivity = &asked_.request};
    ASSERT_TRUE(client->solve_batch({&item, 1}, [&](std::int64_t, const Expected<RemoteSolution>& answer) {
      ASSERT_TRUE(answer.has_value()) << answer.error().message();
      expect_same_derivatives(here, *answer);
    }));
    auto session = client->open_session(problem_.view());
    ASSERT_TRUE(session.has_value()) << session.error().message();
    expect_same_derivatives(here, session->solve({}, {.sensitivity = &asked_.request}).value());
  }
  const auto job = there_.jobs().submit(problem_.view(), {}, controls);
  ASSERT_TRUE(job.has_value()) << job.error().message();
  expect_same_derivatives(here, there_.jobs().result(job->job_id, {.wait = true}).value());
}

TEST_F(SensitivityThere, EachTickOfASessionReportsTheSameHereAndThere) {
  examples::HopperParameters parameters{.steps = kAskedSteps};
  auto here = here_.open_session(problem_.view()), there = there_.open_session(problem_.view());
  ASSERT_TRUE(here && there);
  for (int tick = 0; tick < 4; ++tick) {
    SCOPED_TRACE(tick);
    const OwnedProblem now = examples::hopper(parameters);
    UpdateControls controls{.sensitivity = &asked_.request};
    if (tick > 0) controls.shift = Shift::by_stage(problem_.view(), kAskedSteps).value();
    const ProblemUpdate update{.c0 = now.c0, .g = now.g, .b = now.b, .d = now.d, .l = now.l, .r = now.r};
    const auto a = here->solve(update, controls), b = there->solve(update, controls);
    ASSERT_TRUE(a && b);
    EXPECT_EQ(a->z, b->z);
    expect_same_derivatives(*a, *b);
    parameters = examples::advance(parameters, a->z);
  }
  const auto without = there->solve();
  ASSERT_TRUE(without.has_value()) << without.error().message();
  EXPECT_FALSE(without->sensitivity.has_value()) << "nothing was asked this time";
}

TEST_F(SensitivityThere, WhatDoesNotFitIsTheSameErrorHereAndThere) {
  const auto expect_same_refusal = [&](const std::function<void(SensitivityRequest&)>& spoil,
                                       const char* field, std::int64_t index) {
    SensitivityRequest request = asked_.request;
    spoil(request);
    for (const Client* client : {&here_, &there_}) {
      SCOPED_TRACE(client->address());
      const auto answer = client->solve(problem_.view(), {}, {.sensitivity = &request});
      ASSERT_FALSE(answer.has_value());
      EXPECT_EQ(answer.error().code, ErrorCode::invalid_argument) << answer.error().message();
      EXPECT_EQ(answer.error().field, field);
      EXPECT_EQ(answer.error().index, index);
      auto session = client->open_session(problem_.view());
      EXPECT_EQ(session->solve({}, {.sensitivity = &request}).error().field, field);
      EXPECT_TRUE(session->solve().has_value()) << "the session goes on";
    }
  };
  Values bad = asked_.proximal;
  bad[2] = -1.0;
  expect_same_refusal([&](auto& r) { r.rows->proximal = bad; }, "sensitivity.rows.proximal", 2);
  expect_same_refusal([&](auto& r) { r.rows->g = std::span(bad).first(1); }, "sensitivity.rows.g", -1);
  SparseMatrix E = asked_.E;
  E.row_indices[1] = 7;
  expect_same_refusal([&](auto& r) { r.rows->E = E.view(); }, "sensitivity.rows.E.row_indices", 1);
  expect_same_refusal([&](auto& r) { r.directions.count = -2; }, "sensitivity.directions.count", -1);
  expect_same_refusal([&](auto& r) { r.directions.numbers.A = bad; }, "sensitivity.directions.A.values", -1);
  expect_same_refusal([&](auto& r) { r.losses.weights.complementarity_multipliers_L = bad; },
                      "sensitivity.losses.complementarity_multipliers_L", -1);
}

TEST_F(SensitivityThere, MoreThanTheServersLimitsIsRefusedByNameAndBound) {
  const auto refused = [&](const SensitivityRequest& request) {
    const auto answer = there_.solve(problem_.view(), {}, {.sensitivity = &request});
    EXPECT_EQ(answer.error().code, ErrorCode::resource_exhausted);
    auto session = there_.open_session(problem_.view());
    const auto update = session->solve({}, {.sensitivity = &request});
    EXPECT_EQ(update.error().message(), answer.error().message());
    EXPECT_TRUE(session->solve().has_value()) << "the session goes on";
    return answer.error().message();
  };
  const Asked more(problem_, 6);
  EXPECT_EQ(refused({.rows = more.request.rows}),
            "sensitivity.rows.E.rows = 6: must be at most 5 (sensitivity_rows)");
  const Values three(3 * problem_.b.size(), 1.0), two(2 * problem_.g.size(), 1.0);
  EXPECT_EQ(refused({.directions = {3, {.b = three}}, .losses = {2, {.z = two}}}),
            "sensitivity.directions.count = 5: must be at most 4 (sensitivity_directions)");
}

TEST_F(SensitivityThere, TheServerReportsItsLimits) {
  const auto info = there_.info();
  ASSERT_TRUE(info.has_value()) << info.error().message();
  EXPECT_EQ(info->sensitivity_rows, 5);
  EXPECT_EQ(info->sensitivity_directions, 4);
  EXPECT_GT(info->sensitivity_bytes, 0);
}

TEST(SensitivityLimitsThere, BytesOfRequestAndAnswerAreBounded) {
  const ServerProcess server(MARBLE_SERVER_BINARY, {"--sensitivity-bytes", "4096"});
  const Client client = Client::connect(server.address()).value();
  const OwnedProblem problem = examples::hopper({.steps = kAskedSteps});
  const Asked asked(problem);
  const auto answer = client.solve(problem.view(), {}, {.sensitivity = &asked.request});
  EXPECT_EQ(answer.error().code, ErrorCode::resource_exhausted);
  EXPECT_EQ(answer.error().field, "sensitivity");
  EXPECT_TRUE(answer.error().bound.starts_with("must be at most 4096 (sensitivity_bytes"))
      << answer.error().bound;
}

TEST_F(SensitivityThere, WhatIsNotSolvedSaysSoAndIsNoError) {
  Options options;
  options.max_iterations = 1;
  options.max_local_search_factorizations = options.max_feasibility_factorizations = 0;
  options.polish = false;
  for (const Client* client : {&here_, &there_}) {
    SCOPED_TRACE(client->address());
    const auto answer = client->solve(problem_.view(), options, {.sensitivity = &asked_.request});
    ASSERT_TRUE(answer.has_value()) << answer.error().message();
    ASSERT_TRUE(answer->sensitivity.has_value() && !answer->sensitivity->has_value());
    EXPECT_EQ(answer->sensitivity->error().code, ErrorCode::failed_precondition);
    EXPECT_EQ(answer->sensitivity->error().message(),
              std::string("solution: must be solved: it is ") + to_string(answer->status));
  }
}

TEST_F(SensitivityThere, AFirstPartHasNoAnswerAndNoDerivatives) {
  for (const Client* client : {&here_, &there_}) {
    auto session = client->open_session(problem_.view());
    EXPECT_EQ(session->prepare({}, {.sensitivity = &asked_.request}).error().message(),
              "sensitivity: must come with the second part of an update");
    ASSERT_TRUE(session->prepare({.g = problem_.g}).has_value());
    EXPECT_TRUE(session->solve({}, {.sensitivity = &asked_.request})->sensitivity.has_value());
  }
}

}  // namespace
}  // namespace marble::testing
