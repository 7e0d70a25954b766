// A random point of a random subproblem, and every backend that can solve its linear system.
#pragma once

#include <memory>
#include <vector>

#include "kkt/dense_kkt.h"
#include "kkt/sparse_kkt.h"
#include "model/residual.h"
#include "random_vector.h"
#include "support/random_problem.h"

namespace marble::testing {

inline ScaledProblem scaled(const OwnedProblem& problem, int passes = 10) {
  return scale(Problem::create(problem.view()).value(), passes);
}

/// The sizes with every combination of empty and filled constraint blocks.
inline std::vector<RandomSizes> all_shapes() {
  std::vector<RandomSizes> shapes;
  for (const Index n_e : {0, 3}) {
    for (const Index n_i : {0, 5}) {
      for (const Index n_c : {0, 4})
        shapes.push_back({.variables = 14, .equalities = n_e, .inequalities = n_i, .pairs = n_c});
    }
  }
  return shapes;
}

struct Setting {
  explicit Setting(const RandomSizes& sizes, std::uint64_t seed, double kappa = 0.1, double rho = 50.0)
      : owned(random_problem(sizes, seed)),
        problem(scaled(owned)),
        sub(problem),
        x(problem),
        r(problem),
        images(problem) {
    RandomVectors random(seed);
    random.fill(x.all);
    sub.kappa = kappa;
    sub.rho = rho;
    for (Vector* estimate : {&sub.equality_estimate, &sub.row_estimate.all}) random.fill(*estimate);
    images.evaluate(problem, x);
    residual(sub, images, x, r);
  }
  OwnedProblem owned;
  ScaledProblem problem;
  Subproblem sub;
  Iterate x, r;
  Images images;
};

inline std::vector<std::unique_ptr<Kkt>> backends(const ScaledProblem& p) {
  std::vector<std::unique_ptr<Kkt>> all;
  for (const KeptRows kept : {KeptRows::none, KeptRows::dense, KeptRows::all})
    all.push_back(SparseKkt::analyse(p, kept));
  all.push_back(std::make_unique<DenseKkt>(p));
  for (const auto& kkt : all) static_cast<void>(kkt->allocate(p));
  return all;
}

}  // namespace marble::testing
