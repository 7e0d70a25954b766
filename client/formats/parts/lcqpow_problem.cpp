#include "parts/lcqpow_problem.h"

#include <algorithm>

#include "parts/assembler.h"

namespace marble::formats {
namespace {

std::string size_text(const TableMatrix& table) {
  return std::to_string(table.rows) + " x " + std::to_string(table.columns);
}

class LcqpowReader {
 public:
  explicit LcqpowReader(const TableReader& read) : read_(read) {}

  Expected<ProblemFile> assemble(const std::string& name) {
    const auto Q = table("Q", true);
    const auto g_table = table("g", true);
    if (failed_) return unexpected(error_);
    n_ = static_cast<std::size_t>(std::max(Q->rows, Q->columns));
    const auto g = vector("g", n_, 0.0);
    if (Q->rows != Q->columns) fail(invalid("Q", size_text(*Q), "must be square"));
    Assembler problem(static_cast<Index>(n_));
    if (!failed_) {
      for (std::size_t k = 0; k < Q->entries.values.size(); ++k)
        problem.add_quadratic(Q->entries.rows[k], Q->entries.columns[k], Q->entries.values[k]);
      for (std::size_t i = 0; i < n_; ++i) problem.add_linear(static_cast<Index>(i), g[i]);
    }
    add_rows(problem);
    add_bounds(problem);
    add_pairs(problem);
    const auto x0 = vector("x0", n_, 0.0);
    const bool starts = table("x0", false).has_value();
    if (failed_) return unexpected(error_);
    auto made = problem.finish(name);
    if (!made) return unexpected(made.error());
    ProblemFile file{std::move(*made), std::nullopt};
    if (starts) file.problem.initial_z = x0;
    return file;
  }

 private:
  void fail(Error error) {
    if (!failed_) error_ = std::move(error);
    failed_ = true;
  }

  std::optional<TableMatrix> table(const char* name, bool needed) {
    auto read = read_(name);
    if (!read) {
      fail(read.error());
      return std::nullopt;
    }
    if (!*read && needed) fail(invalid(name, "is missing"));
    return std::move(*read);
  }

  // Returns a vector filled with `missing` if it is absent or empty.
  std::vector<double> vector(const char* name, std::size_t size, double missing) {
    const auto found = table(name, false);
    if (failed_ || !found || found->rows == 0 || found->columns == 0)
      return std::vector<double>(size, missing);
    auto values = vector_of(*found, size, name);
    if (values) return std::move(*values);
    fail(values.error());
    return std::vector<double>(size, missing);
  }

  std::vector<AffineRow> rows(const char* name) {
    const auto found = table(name, false);
    if (failed_ || !found || found->rows == 0) return {};
    if (static_cast<std::size_t>(found->columns) != n_) {
      fail(invalid(name, size_text(*found), "must have " + std::to_string(n_) + " columns, as many as Q"));
      return {};
    }
    std::vector<AffineRow> rows(static_cast<std::size_t>(found->rows));
    for (std::size_t k = 0; k < found->entries.values.size(); ++k) {
      rows[static_cast<std::size_t>(found->entries.rows[k])].terms.emplace_back(found->entries.columns[k],
                                                                                found->entries.values[k]);
    }
    return rows;
  }

  void add_range(Assembler& problem, const AffineRow& row, double low, double high, const char* field,
                 std::size_t index) {
    const auto added = problem.add_range(row, low, high, field, static_cast<std::int64_t>(index));
    if (!added) fail(added.error());
  }

  void add_rows(Assembler& problem) {
    const auto A = rows("A");
    const auto low = vector("lbA", A.size(), -kInfinity);
    const auto high = vector("ubA", A.size(), kInfinity);
    for (std::size_t i = 0; i < A.size() && !failed_; ++i)
      add_range(problem, A[i], low[i], high[i], "lbA", i);
  }

  void add_bounds(Assembler& problem) {
    const auto low = vector("lb", n_, -kInfinity);
    const auto high = vector("ub", n_, kInfinity);
    for (std::size_t i = 0; i < n_ && !failed_; ++i)
      add_range(problem, AffineRow::variable(static_cast<Index>(i)), low[i], high[i], "lb", i);
  }

  void add_pairs(Assembler& problem) {
    auto left = rows("L");
    auto right = rows("R");
    if (left.size() != right.size())
      fail(invalid("R", std::to_string(right.size()) + " rows",
                   "must be " + std::to_string(left.size()) + ", as in L"));
    const auto low_left = vector("lbL", left.size(), 0.0), low_right = vector("lbR", right.size(), 0.0);
    const auto high_left = vector("ubL", left.size(), kInfinity),
               high_right = vector("ubR", right.size(), kInfinity);
    for (std::size_t i = 0; i < left.size() && !failed_; ++i) {
      add_range(problem, left[i], -kInfinity, high_left[i], "ubL", i);
      add_range(problem, right[i], -kInfinity, high_right[i], "ubR", i);
      left[i].constant = -low_left[i];
      right[i].constant = -low_right[i];
      problem.add_pair(left[i], right[i]);
    }
  }

  const TableReader& read_;
  std::size_t n_ = 0;
  bool failed_ = false;
  Error error_;
};

}  // namespace

Expected<std::vector<double>> vector_of(const TableMatrix& table, std::size_t size,
                                        const std::string& field) {
  const bool row = table.rows == 1 && static_cast<std::size_t>(table.columns) == size;
  const bool column = table.columns == 1 && static_cast<std::size_t>(table.rows) == size;
  if (!row && !column)
    return unexpected(invalid(field, size_text(table), "must have " + std::to_string(size) + " entries"));
  std::vector<double> values(size, 0.0);
  for (std::size_t k = 0; k < table.entries.values.size(); ++k)
    values[static_cast<std::size_t>(std::max(table.entries.rows[k], table.entries.columns[k]))] =
        table.entries.values[k];
  return values;
}

Expected<ProblemFile> assemble_lcqpow(const TableReader& read, const std::string& name) {
  return LcqpowReader(read).assemble(name);
}

}  // namespace marble::formats
