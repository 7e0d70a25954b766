// The one linear system of the solver, whatever asks for it:
//
//   [ H   Aᵀ   ] [x]   [f]          H = Q + δI + Σ_r k_r e_r e_rᵀ
//   [ A  −I/ρ  ] [y] = [h]
//
// over the rows e_r of the inequalities and the pairs, each with its weight k_r. A pair's two rows are turned
// by an angle: cos·L_i + sin·R_i with the weight of its row s and sin·L_i − cos·R_i with that of its row t. A
// row enters H as a rank-one term or is kept as a row of its own, [e_r, −1/k_r]: the backend decides once, by
// the fill each way causes.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string_view>

#include "data/interrupt.h"
#include "data/scaling.h"

namespace marble {

struct RowWeights {
  explicit RowWeights(const ScaledProblem& problem)
      : rows(problem.layout), cosine(Vector::Ones(problem.pairs())), sine(Vector::Zero(problem.pairs())) {
    rows.all.setZero();
  }

  double rho = 1.0;     ///< ρ of the equality rows, > 0
  double delta = 0.0;   ///< δ ≥ 0
  RowVector rows;       ///< ≥ 0, as made 0; a negative one of a pair makes H lose convexity
  Vector cosine, sine;  ///< n_c, of the angle; as made, no turn
};

/// Factorizes and solves the system above. Allocates only in its constructor and in allocate(). Whatever
/// takes long ends early, with false, where it is interrupted; what it has made till then is of no use.
class Kkt {
 public:
  virtual ~Kkt() = default;
  /// From now on this may interrupt it.
  void attend(const Interrupt& interrupt) { interrupt_ = interrupt; }
  [[nodiscard]] const Interrupt& interrupt() const { return interrupt_; }

  /// Takes the memory for factors and workspace, and the problem's values. Once, after the analysis.
  [[nodiscard]] virtual bool allocate(const ScaledProblem& problem) = 0;
  /// Takes new values of the matrices, of the pattern it was made for. Allocates nothing.
  virtual void load(const ScaledProblem& problem) = 0;
  /// Assembles and factorizes in place. True if the inertia is right, which means that H + ρAᵀA is positive
  /// definite: n positive and n_e negative pivots (plus what the kept rows' own signs ask for).
  [[nodiscard]] bool factor(const RowWeights& weights) {
    ++factors_;
    return factorize(weights);
  }
  /// Another number after each factor(): whose factor is at hand, where several engines share one.
  [[nodiscard]] std::int64_t factors() const { return factors_; }
  /// Solves for (x, y) in place of (f, h), with one step of iterative refinement.
  [[nodiscard]] virtual bool solve(VectorRef x, VectorRef y) = 0;
  /// The same without the refinement: for whoever refines by a system of his own.
  [[nodiscard]] bool solve_once(VectorRef x, VectorRef y) { return solve_many(x.data(), y.data(), 1); }
  /// The same of 1, 2, 4 or 8 right-hand sides at once: number k of row i at [i · count + k], both aligned as
  /// a LanePair. For more than one it takes memory, which bytes() counts, when it is first asked.
  [[nodiscard]] virtual bool solve_many(double* x, double* y, int count) = 0;
  /// x for a right-hand side f with few entries and h = 0, without the refinement: for the many solves of a
  /// local search.
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

/// What a backend may take, or what the least of them would.
struct KktCost {
  double bytes = std::numeric_limits<double>::infinity();
  double flops = std::numeric_limits<double>::infinity();  ///< in the units of Kkt::flops()
};

/// Analyses the problem's pattern and picks the cheapest backend for it that fits into `most`. Null if it was
/// interrupted, or if none does; `least` then tells what the smallest would need, or the cheapest that has
/// enough memory, as far as that is known.
std::unique_ptr<Kkt> make_kkt(const ScaledProblem& problem, const KktCost& most, const Interrupt& interrupt,
                              KktCost& least);

/// The same without a limit.
std::unique_ptr<Kkt> make_kkt(const ScaledProblem& problem, const Interrupt& interrupt = {});

}  // namespace marble
