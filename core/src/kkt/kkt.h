// The linear system that all engines of the solver use:
//
//   [ H   Aᵀ   ] [x]   [f]          H = Q + δI + Σ_r k_r e_r e_rᵀ
//   [ A  −I/ρ  ] [y] = [h]
//
// over the rows e_r of the inequalities and the pairs, each with its weight k_r. A pair's two rows are
// rotated by an angle: cos·L_i + sin·R_i has the weight of its row s, and sin·L_i − cos·R_i that of its row
// t. A row either enters H as a rank-one term or is kept as a row of the system, [e_r, −1/k_r]. The backend
// decides this once, by the fill-in of each choice.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string_view>

#include "model/interrupt.h"
#include "model/scaling.h"

namespace marble {

struct RowWeights {
  explicit RowWeights(const ScaledProblem& problem)
      : rows(problem.layout), cosine(Vector::Ones(problem.pairs())), sine(Vector::Zero(problem.pairs())) {
    rows.all.setZero();
  }

  double rho = 1.0;     ///< ρ of the equality rows, > 0
  double delta = 0.0;   ///< δ ≥ 0
  RowVector rows;       ///< ≥ 0, initially 0; a negative weight of a pair makes H lose convexity
  Vector cosine, sine;  ///< n_c, of the angle; initially no rotation
};

/// Factorizes and solves the system above. Allocates only in its constructor and in allocate(). Long
/// operations end early with false if they are interrupted; their partial results must not be used.
class Kkt {
 public:
  virtual ~Kkt() = default;
  /// Sets the interrupt that ends the following operations.
  void attend(const Interrupt& interrupt) { interrupt_ = interrupt; }
  [[nodiscard]] const Interrupt& interrupt() const { return interrupt_; }

  /// Allocates factors and workspace, and loads the problem's values. Call once, after the analysis.
  [[nodiscard]] virtual bool allocate(const ScaledProblem& problem) = 0;
  /// Loads new values of the matrices, with the pattern it was made for. Allocates nothing.
  virtual void load(const ScaledProblem& problem) = 0;
  /// Assembles and factorizes in place. Returns true if the inertia is right, that is, H + ρAᵀA is positive
  /// definite: n positive and n_e negative pivots, plus those that the signs of the kept rows require.
  [[nodiscard]] bool factor(const RowWeights& weights) {
    ++factors_;
    return factorize(weights);
  }
  /// Returns a number that changes with each factor(). It identifies the current factor if several engines
  /// share one Kkt.
  [[nodiscard]] std::int64_t factors() const { return factors_; }
  /// Solves for (x, y) in place of (f, h), with one step of iterative refinement.
  [[nodiscard]] virtual bool solve(VectorRef x, VectorRef y) = 0;
  /// The same without refinement, for callers that refine with their own system.
  [[nodiscard]] bool solve_once(VectorRef x, VectorRef y) { return solve_many(x.data(), y.data(), 1); }
  /// The same for 1, 2, 4 or 8 right-hand sides at once: number k of row i is at [i · count + k]; both are
  /// aligned like a LanePair. The first call with more than one allocates memory, which bytes() includes.
  [[nodiscard]] virtual bool solve_many(double* x, double* y, int count) = 0;
  /// Returns x for a right-hand side f with few entries and h = 0, without refinement. For the many solves of
  /// a local search.
  [[nodiscard]] virtual bool solve_sparse(std::span<const Index> indices, std::span<const double> values,
                                          VectorRef x) = 0;
  [[nodiscard]] virtual std::string_view name() const = 0;  ///< "sparse condensed", ...
  [[nodiscard]] virtual double flops() const = 0;           ///< estimate for one factorization with assembly
  [[nodiscard]] virtual double bytes()
      const = 0;  ///< memory of factor and workspace, known before allocate()

 private:
  [[nodiscard]] virtual bool factorize(const RowWeights& weights) = 0;

  Interrupt interrupt_;
  std::int64_t factors_ = 0;
};

/// Limits of the cost of a backend, or the least cost found.
struct KktCost {
  double bytes = std::numeric_limits<double>::infinity();
  double flops = std::numeric_limits<double>::infinity();  ///< in the units of Kkt::flops()
};

/// Analyses the problem's pattern and selects the cheapest backend that fits into `most`. Returns null if it
/// was interrupted or if none fits. `least` then contains, as far as known, the cost of the smallest backend,
/// or of the cheapest one with enough memory.
std::unique_ptr<Kkt> make_kkt(const ScaledProblem& problem, const KktCost& most, const Interrupt& interrupt,
                              KktCost& least);

/// The same without a limit.
std::unique_ptr<Kkt> make_kkt(const ScaledProblem& problem, const Interrupt& interrupt = {});

}  // namespace marble
