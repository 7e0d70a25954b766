// Provides the smooth function of a reference method: θ and a term for each row, with bounds as its only
// constraints. K. Murty, "Algorithms for NLP with nonlinear constraints" (lectures). With a row's value v,
// its weight μ and its multiplier π:
//
//   equality, and G·H of a pair    πv + μv²
//   inequality, and G and H        (max(0, π − 2μv)² − π²) / 4μ      penalty (π = 0) and alag
//                                  −μ log v                          barrier; its equalities: weight 1/μ
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "marble/problem.h"
#include "nonlinear/curvature.h"
#include "nonlinear/functions.h"
#include "nonlinear/merit.h"

namespace marble::nonlinear {

// Provides the curvature that squares of rows contribute: Σ α aaᵀ + β bbᵀ + γ (abᵀ + baᵀ) of rows a, b of
// sparse Jacobians; its upper triangle is added into a fixed pattern.
class OuterProducts {
 public:
  /// Starts with the pattern of `upper`; add() extends it by the products of rows.
  explicit OuterProducts(const SparseMatrix& upper);

  /// Adds a product for each row of A, or of A and B if B is given, with as many rows. Call before close().
  void add(const SparseMatrix& A, const SparseMatrix* B = nullptr);
  void close();

  /// Sets the values to those of `upper`; zero elsewhere.
  void begin(const SparseMatrix& upper);
  /// Adds the product of row i of the added part `part`, with the current A and B.
  void take(std::size_t part, std::size_t i, const SparseMatrix& A, double alpha,
            const SparseMatrix* B = nullptr, double beta = 0.0, double gamma = 0.0);

  [[nodiscard]] const SparseMatrix& sum() const { return sum_; }

 private:
  struct Entry {
    Index column;
    Index a, b;  // of its value in A and B, or −1
  };
  struct Product {
    std::vector<Entry> entries;    // by columns
    std::vector<Index> positions;  // in the sum, for each two of the entries
  };
  [[nodiscard]] Index position(Index row, Index column) const;

  std::vector<std::vector<Product>> parts_;
  std::vector<std::vector<Index>> columns_;  // rows of each column, until it is closed
  std::vector<Index> of_upper_;
  SparseMatrix first_, sum_;
};

/// An error of a caller's function, passed through the loop as an exception.
struct Refused {
  Error error;
};

class Auxiliary {
 public:
  enum Part : std::size_t { equalities, inequalities, sides_G, sides_H, products, kParts };
  struct Row {
    double weight, multiplier;  // μ and π
  };
  struct Seen {
    std::vector<double> x;
    double objective = 0.0, violation = 0.0;
  };

  /// For a problem that is defined at functions.start(), at least in its sizes. All must outlive it, and it
  /// must not move.
  Auxiliary(const Problem& problem, Functions& functions, const Settings& settings, Point first);
  Auxiliary(const Auxiliary&) = delete;
  Auxiliary& operator=(const Auxiliary&) = delete;

  /// θ and all terms, for the loop. Its functions throw Refused.
  [[nodiscard]] const Problem& problem() const { return made_; }

  [[nodiscard]] std::array<std::vector<Row>, kParts>& rows() { return rows_; }
  /// Sets the weight of all rows, for a penalty or the barrier.
  void set_weight(double mu);

  /// Returns the functions at x.
  const Point& at(std::span<const double> x);
  /// Computes all multipliers but the bounds' from the terms' slopes at x; 0 for a row that is further than
  /// `tolerance` from its bound.
  void multipliers(std::span<const double> x, double tolerance, Multipliers& multipliers);
  [[nodiscard]] const Linearisation& linearisation() const { return at_; }
  /// The value that must be zero: |v| for a row penalised on both sides, |min(v, π/2μ)| for an inequality.
  [[nodiscard]] double residual(Part part, std::size_t i) const;
  /// The estimate of π at the minimum over x: the slope of the row's term.
  [[nodiscard]] double estimate(Part part, std::size_t i) const { return term(part, i).estimate; }
  /// Returns Σ log of the rows that must be positive.
  [[nodiscard]] double barrier() const;
  [[nodiscard]] double violation() const;
  /// Returns the caller's last numbers that were not finite, or not in the interior.
  [[nodiscard]] const std::optional<Error>& fault() const { return fault_; }
  /// Returns the linearisation at x, which was one of the last two points.
  [[nodiscard]] const Seen& seen(std::span<const double> x) const {
    return seen_[same(seen_[0].x, x) ? 0 : 1];
  }

 private:
  struct Term {
    double value = 0.0, estimate = 0.0, curvature = 0.0;
  };
  [[nodiscard]] static bool same(std::span<const double> a, std::span<const double> b);
  [[nodiscard]] bool is_two_sided(Part part) const { return part == equalities || part == products; }
  [[nodiscard]] double value(Part part, std::size_t i) const;
  [[nodiscard]] Term term(Part part, std::size_t i) const;
  void find_fault();
  Values values(std::span<const double> x);
  Derivatives derivatives(std::span<const double> x);
  SparseMatrixView hessian(std::span<const double> x);
  void linearise(std::span<const double> x);
  void move_curvature();
  void estimate_multipliers(Multipliers& m) const;

  Problem made_;
  Functions& functions_;
  const bool barrier_;
  const Curvature kind_;  // of the caller's Lagrangian; the terms' own curvature is exact
  std::array<std::vector<Row>, kParts> rows_;
  Point point_;
  Linearisation at_;
  std::vector<double> linearised_;  // x of at_
  bool there_ = false;              // point_ has the values of its x
  std::vector<double> gradient_;
  Multipliers multipliers_;
  std::optional<Model> B_;
  std::vector<double> last_x_, step_, change_, slope_;
  Linearisation last_;  // the point of B_
  std::optional<OuterProducts> hessian_;
  std::optional<Error> fault_;
  std::array<Seen, 2> seen_;
};

}  // namespace marble::nonlinear
