// Provides the curvature that squares of rows contribute: Σ α aaᵀ + β bbᵀ + γ (abᵀ + baᵀ) of rows a, b of
// sparse Jacobians; its upper triangle is added into a fixed pattern.
#pragma once

#include <span>
#include <vector>

#include "marble/problem.h"

namespace marble::nonlinear {

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

}  // namespace marble::nonlinear
