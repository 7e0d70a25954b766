// Curvature that squares of rows bring: Σ α aaᵀ + β bbᵀ + γ (abᵀ + baᵀ) of rows a, b of sparse Jacobians, its
// upper triangle added into a fixed pattern.
#pragma once

#include <span>
#include <vector>

#include "marble/problem.h"

namespace marble::nonlinear {

class OuterProducts {
 public:
  /// The pattern: that of `upper` and of the products of all rows added.
  explicit OuterProducts(const SparseMatrix& upper);

  /// A product for each row of A; of A and B where B is there, of as many rows. Before close().
  void add(const SparseMatrix& A, const SparseMatrix* B = nullptr);
  void close();

  /// The values of `upper`; zero elsewhere.
  void begin(const SparseMatrix& upper);
  /// Of row i of what was added as number `part`, with A and B as they are now.
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
    std::vector<Index> positions;  // in the sum, of each two of them
  };
  [[nodiscard]] Index position(Index row, Index column) const;

  std::vector<std::vector<Product>> parts_;
  std::vector<std::vector<Index>> columns_;  // rows of each, until it is closed
  std::vector<Index> of_upper_;
  SparseMatrix first_, sum_;
};

}  // namespace marble::nonlinear
