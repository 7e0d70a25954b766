#include "support/coupled_problems.h"

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>
#include <utility>

#include "marble/examples.h"
#include "support/dense_matrix.h"

namespace marble::testing {
namespace {

// Unit variance: a sum of four uniform numbers, because the standard's distributions differ between
// libraries.
class Bell {
 public:
  explicit Bell(std::uint64_t seed) : engine_(seed) {}
  double operator()() {
    double sum = 0.0;
    for (int i = 0; i < 4; ++i) sum += static_cast<double>(engine_() >> 11) * 0x1p-52 - 1.0;
    return 0.5 * std::sqrt(3.0) * sum;
  }
  Eigen::MatrixXd matrix(Index rows, Index columns) {
    return Eigen::MatrixXd::NullaryExpr(rows, columns, [this] { return (*this)(); });
  }
  std::vector<double> vector(Index size, double factor = 1.0) {
    std::vector<double> values(static_cast<std::size_t>(size));
    for (double& value : values) value = factor * (*this)();
    return values;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace

CoupledView OwnedCoupled::view() const {
  CoupledView view{{}, coupling_rhs};
  for (std::size_t k = 0; k < blocks.size(); ++k)
    view.blocks.push_back({blocks[k].name, blocks[k].view(), coupling[k].view()});
  return view;
}

OwnedCoupled random_coupled(const CoupledSizes& sizes, std::uint64_t seed) {
  Bell bell(seed);
  const Index n = sizes.variables;
  OwnedCoupled coupled;
  for (Index k = 0; k < sizes.blocks; ++k) {
    OwnedProblem p;
    p.name = "agent " + std::to_string(k);
    const Eigen::MatrixXd root = bell.matrix(n, n);
    Eigen::MatrixXd Q = root * root.transpose() / static_cast<double>(n);
    Q.diagonal().array() += 0.5;
    p.Q = sparse(0.5 * (Q + Q.transpose()));
    p.g = bell.vector(n, 2.0);
    if (sizes.pairs > 0) {
      p.L = sparse(bell.matrix(sizes.pairs, n));
      p.l = bell.vector(sizes.pairs);
      p.R = sparse(bell.matrix(sizes.pairs, n));
      p.r = bell.vector(sizes.pairs);
    }
    coupled.coupling.push_back(sparse(bell.matrix(sizes.rows, n)));
    coupled.blocks.push_back(std::move(p));
  }
  coupled.coupling_rhs = bell.vector(sizes.rows);
  return coupled;
}

OwnedCoupled hoppers_on_a_budget(int hoppers, int steps, double budget) {
  OwnedCoupled coupled;
  Triplets diagonal;
  for (int step = 0; step < steps; ++step) diagonal.add(step, step, 1.0);
  for (int k = 0; k < hoppers; ++k) {
    examples::HopperParameters parameters;
    parameters.steps = steps;
    coupled.blocks.push_back(examples::hopper(examples::vary(parameters, static_cast<std::uint64_t>(k))));
    Triplets forces;
    for (int step = 0; step < steps; ++step)
      forces.add(step, examples::hopper_index(step, examples::kForceZ), 1.0);
    coupled.coupling.push_back(
        compress(steps, static_cast<Index>(coupled.blocks.back().g.size()), forces, "coupling").value());
  }
  OwnedProblem left;
  left.name = "left of the budget";
  left.g.assign(static_cast<std::size_t>(steps), 0.0);
  left.d = left.g;
  left.C = compress(steps, steps, diagonal, "C").value();
  coupled.coupling.push_back(left.C);
  coupled.blocks.push_back(std::move(left));
  coupled.coupling_rhs.assign(static_cast<std::size_t>(steps), budget);
  return coupled;
}

}  // namespace marble::testing
