#include "problems.h"

#include <cmath>

#include "marble/convert.h"
#include "marble/examples.h"

namespace marble::testing {
namespace {

SparseMatrix matrix(Index rows, Index columns, const Triplets& entries) {
  return compress(rows, columns, entries, "matrix").value();
}

Triplets identity(Index n, double value) {
  Triplets entries;
  for (Index i = 0; i < n; ++i) entries.add(i, i, value);
  return entries;
}

// State x, control u, force f a step: x' = x + u + f/2, 0 <= f _|_ x + 1/2 >= 0, |u| <= 1, the cost pulls x
// to a wave.
OwnedProblem chain(Index steps) {
  const Index n = 3 * steps;
  OwnedProblem p;
  p.name = "chain";
  p.Q = matrix(n, n, identity(n, 1.0));
  p.g.assign(static_cast<std::size_t>(n), 0.0);
  p.b.assign(static_cast<std::size_t>(steps), 0.0);
  p.d.assign(static_cast<std::size_t>(2 * steps), 1.0);
  p.l.assign(static_cast<std::size_t>(steps), 0.0);
  p.r.assign(static_cast<std::size_t>(steps), 0.5);
  Triplets a, c, l, r;
  for (Index k = 0; k < steps; ++k) {
    const Index x = 3 * k, u = x + 1, f = x + 2;
    p.g[static_cast<std::size_t>(x)] = std::sin(0.1 * k);
    if (k > 0) a.add(k, x - 3, -1.0);
    a.add(k, x, 1.0);
    a.add(k, u, -1.0);
    a.add(k, f, -0.5);
    c.add(2 * k, u, 1.0);
    c.add(2 * k + 1, u, -1.0);
    l.add(k, f, 1.0);
    r.add(k, x, 1.0);
  }
  p.A = matrix(steps, n, a);
  p.C = matrix(2 * steps, n, c);
  p.L = matrix(steps, n, l);
  p.R = matrix(steps, n, r);
  return p;
}

}  // namespace

v1::SolveRequest example_request() {
  OwnedProblem p;
  p.Q = matrix(4, 4, identity(4, 2.0));
  p.g.assign(4, 0.0);
  Triplets a, c, l, r;
  a.add(0, 0, 1.0);
  c.add(0, 1, 1.0);
  l.add(0, 2, 1.0);
  r.add(0, 3, 1.0);
  p.A = matrix(1, 4, a);
  p.C = matrix(1, 4, c);
  p.L = matrix(1, 4, l);
  p.R = matrix(1, 4, r);
  p.b = {-1.0};
  p.d = {-1.0};
  p.l = {1.0};
  p.r = {-1.0};
  v1::SolveRequest request;
  to_message(p.view(), request.mutable_problem());
  request.mutable_problem()->set_name("example");
  return request;
}

v1::SolveRequest long_request(int max_iterations) {
  static const OwnedProblem problem = chain(2000);
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  request.mutable_problem()->set_name("long");
  v1::SolveOptions* options = request.mutable_options();
  options->set_path(v1::PATH_PAPER);
  options->set_polish(false);
  options->set_max_iterations(max_iterations);
  options->set_kappa_initial(1.0);
  options->set_rho_initial(1.0);
  options->set_rho_factor(1.00001);
  options->set_rho_max(1e12);
  options->set_equality_tolerance(1e-14);
  options->set_inequality_tolerance(1e-14);
  options->set_complementarity_tolerance(1e-14);
  options->set_stationarity_tolerance(1e-14);
  return request;
}

v1::SolveRequest long_proof() {
  static const OwnedProblem problem = examples::qpec({40, 80, 40, 40}, 0);
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  request.mutable_problem()->set_name("long proof");
  request.mutable_options()->set_global_search(true);
  request.mutable_options()->set_node_limit(1'000'000'000);
  return request;
}

}  // namespace marble::testing
