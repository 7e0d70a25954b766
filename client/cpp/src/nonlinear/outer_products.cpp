#include "nonlinear/outer_products.h"

#include <algorithm>

namespace marble::nonlinear {

OuterProducts::OuterProducts(const SparseMatrix& upper)
    : columns_(static_cast<std::size_t>(upper.columns)), first_(upper) {
  for (Index j = 0; j < upper.columns; ++j)
    columns_[static_cast<std::size_t>(j)].assign(upper.row_indices.begin() + upper.column_pointers[j],
                                                 upper.row_indices.begin() + upper.column_pointers[j + 1]);
}

void OuterProducts::add(const SparseMatrix& A, const SparseMatrix* B) {
  std::vector<Product> products(static_cast<std::size_t>(A.rows));
  for (Index j = 0; j < A.columns; ++j) {
    for (Index k = A.column_pointers[j]; k < A.column_pointers[j + 1]; ++k)
      products[static_cast<std::size_t>(A.row_indices[k])].entries.push_back({j, k, -1});
    for (Index k = B == nullptr ? 0 : B->column_pointers[j]; B != nullptr && k < B->column_pointers[j + 1];
         ++k) {
      auto& entries = products[static_cast<std::size_t>(B->row_indices[k])].entries;
      if (entries.empty() || entries.back().column != j) entries.push_back({j, -1, -1});
      entries.back().b = k;
    }
  }
  for (const Product& product : products) {
    for (std::size_t q = 0; q < product.entries.size(); ++q)
      for (std::size_t p = 0; p <= q; ++p)
        columns_[static_cast<std::size_t>(product.entries[q].column)].push_back(product.entries[p].column);
  }
  parts_.push_back(std::move(products));
}

void OuterProducts::close() {
  sum_.rows = sum_.columns = static_cast<Index>(columns_.size());
  sum_.column_pointers = {0};
  for (std::vector<Index>& rows : columns_) {
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    sum_.row_indices.insert(sum_.row_indices.end(), rows.begin(), rows.end());
    sum_.column_pointers.push_back(static_cast<Index>(sum_.row_indices.size()));
  }
  columns_ = {};
  sum_.values.assign(sum_.row_indices.size(), 0.0);
  for (Index j = 0; j < first_.columns; ++j)
    for (Index k = first_.column_pointers[j]; k < first_.column_pointers[j + 1]; ++k)
      of_upper_.push_back(position(first_.row_indices[k], j));
  for (auto& products : parts_) {
    for (Product& product : products) {
      for (std::size_t q = 0; q < product.entries.size(); ++q)
        for (std::size_t p = 0; p <= q; ++p)
          product.positions.push_back(position(product.entries[p].column, product.entries[q].column));
    }
  }
}

Index OuterProducts::position(Index row, Index column) const {
  const auto begin = sum_.row_indices.begin();
  return static_cast<Index>(
      std::lower_bound(begin + sum_.column_pointers[column], begin + sum_.column_pointers[column + 1], row) -
      begin);
}

void OuterProducts::begin(const SparseMatrix& upper) {
  std::fill(sum_.values.begin(), sum_.values.end(), 0.0);
  for (std::size_t k = 0; k < of_upper_.size(); ++k) sum_.values[of_upper_[k]] = upper.values[k];
}

void OuterProducts::take(std::size_t part, std::size_t i, const SparseMatrix& A, double alpha,
                         const SparseMatrix* B, double beta, double gamma) {
  if (alpha == 0.0 && beta == 0.0 && gamma == 0.0) return;
  const Product& product = parts_[part][i];
  const auto of = [](const SparseMatrix* M, Index k) { return k < 0 ? 0.0 : M->values[k]; };
  auto at = product.positions.begin();
  for (std::size_t q = 0; q < product.entries.size(); ++q) {
    const Entry& right = product.entries[q];
    const double a = of(&A, right.a), b = of(B, right.b);
    for (std::size_t p = 0; p <= q; ++p, ++at) {
      const Entry& left = product.entries[p];
      const double c = of(&A, left.a), d = of(B, left.b);
      sum_.values[*at] += alpha * a * c + beta * b * d + gamma * (a * d + b * c);
    }
  }
}

}  // namespace marble::nonlinear
