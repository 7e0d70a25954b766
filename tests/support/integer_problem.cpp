#include "support/integer_problem.h"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace marble::testing {
namespace {

using Row = std::vector<int>;

class Maker {
 public:
  Maker(IntegerFamily family, std::uint64_t seed, Index most_pairs)
      : family_(family),
        engine_(seed * std::size(kIntegerFamilies) + static_cast<std::uint64_t>(family)),
        n_(between(2, 8)),
        pairs_(between(1, most_pairs)),
        point_(static_cast<std::size_t>(n_)) {}

  OwnedProblem make() {
    OwnedProblem p;
    for (int& entry : point_) entry = between(-3, 3);
    p.g.resize(point_.size());
    for (double& entry : p.g) entry = between(-3, 3);
    set_hessian(p);
    const bool many = family_ == IntegerFamily::equalities;
    const int equalities = many ? between(n_ / 2, n_) : between(0, std::max(0, n_ / 2 - 1));
    const int inequalities = between(0, 5);
    std::vector<Row> rows;
    add_rows(
        equalities, [](int) { return 0; }, rows, p.b);
    p.A = matrix(rows);
    rows.clear();
    add_rows(
        inequalities, [this](int) { return slack(); }, rows, p.d);
    p.C = matrix(rows);
    std::vector<int> side;
    for (int pair = 0; pair < pairs_; ++pair) side.push_back(between(0, 1));
    rows.clear();
    add_rows(
        pairs_, [&](int i) { return side[static_cast<std::size_t>(i)] == 0 ? 0 : slack(); }, rows, p.l);
    p.L = matrix(rows);
    std::vector<Row> others;
    add_rows(
        pairs_, [&](int i) { return side[static_cast<std::size_t>(i)] == 1 ? 0 : slack(); }, others, p.r);
    p.R = matrix(others);
    return p;
  }

 private:
  // Inclusive; uses no distribution, because these differ between libraries.
  int between(int least, int most) {
    return least + static_cast<int>(engine_() % static_cast<std::uint64_t>(most - least + 1));
  }

  int slack() {
    if (family_ == IntegerFamily::any) return between(-4, 4);
    return family_ == IntegerFamily::degenerate && between(0, 3) > 0 ? 0 : between(0, 5);
  }

  Row random_row() {
    Row row(static_cast<std::size_t>(n_));
    const int entries = between(1, std::min(4, n_));
    for (int k = 0; k < entries; ++k) row[static_cast<std::size_t>(between(0, n_ - 1))] = between(-3, 3);
    return row;
  }

  // Adds rows whose value at the point is `value`, except for the last family.
  template <class Value>
  void add_rows(int count, Value value, std::vector<Row>& rows, std::vector<double>& offset) {
    for (int i = 0; i < count; ++i) {
      const bool again = family_ == IntegerFamily::repeated && i > 0 && between(0, 2) > 0;
      if (again) {
        const auto from = static_cast<std::size_t>(between(0, i - 1));
        const int factor = between(1, 2);
        rows.push_back(rows[from]);
        for (int& entry : rows.back()) entry *= factor;
      } else if (between(0, 2) == 0) {
        rows.emplace_back(static_cast<std::size_t>(n_));
        rows.back()[static_cast<std::size_t>(between(0, n_ - 1))] = 1;
      } else {
        rows.push_back(random_row());
      }
      int at = 0;
      for (std::size_t j = 0; j < point_.size(); ++j) at += rows.back()[j] * point_[j];
      offset.push_back(family_ == IntegerFamily::any ? between(-4, 4) : value(i) - at);
    }
  }

  // BᵀB.
  void set_hessian(OwnedProblem& p) {
    int rank = 0;
    switch (family_) {
      case IntegerFamily::linear:
        break;
      case IntegerFamily::singular:
        rank = between(1, std::max(1, n_ / 2));
        break;
      case IntegerFamily::degenerate:
        rank = between(0, n_ / 2);
        break;
      default:
        rank = between(n_ - 1, n_ + 1);
    }
    std::vector<Row> factor;
    for (int i = 0; i < rank; ++i) factor.push_back(random_row());
    Triplets entries;
    for (std::size_t j = 0; j < point_.size(); ++j) {
      for (std::size_t i = 0; i < point_.size(); ++i) {
        int sum = 0;
        for (const Row& row : factor) sum += row[i] * row[j];
        if (sum != 0) entries.add(static_cast<Index>(i), static_cast<Index>(j), sum);
      }
    }
    p.Q = compress(n_, n_, entries, "Q").value();
  }

  [[nodiscard]] SparseMatrix matrix(const std::vector<Row>& rows) const {
    Triplets entries;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (std::size_t j = 0; j < rows[i].size(); ++j) {
        if (rows[i][j] != 0) entries.add(static_cast<Index>(i), static_cast<Index>(j), rows[i][j]);
      }
    }
    return compress(static_cast<Index>(rows.size()), n_, entries, "matrix").value();
  }

  IntegerFamily family_;
  std::mt19937_64 engine_;
  int n_, pairs_;
  Row point_;
};

}  // namespace

std::string_view name(IntegerFamily family) {
  static constexpr std::array<std::string_view, kIntegerFamilies.size()> kNames{
      "convex", "singular", "linear", "degenerate", "repeated", "equalities", "any"};
  return kNames[static_cast<std::size_t>(family)];
}

OwnedProblem integer_problem(IntegerFamily family, std::uint64_t seed, Index most_pairs) {
  OwnedProblem p = Maker(family, seed, most_pairs).make();
  p.name = std::string(name(family)) + "_" + std::to_string(seed);
  return p;
}

}  // namespace marble::testing
