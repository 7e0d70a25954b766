#include "marble/problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "marble/contract.h"
#include "model/check_matrix.h"
#include "model/text_of.h"

namespace marble {
namespace {

Expected<void> check_finite(std::span<const double> values, const std::string& field) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      return unexpected(invalid(field, static_cast<std::int64_t>(i), text_of(values[i]), "must be finite"));
    }
  }
  return {};
}

bool is_empty(const SparseMatrixView& m) {
  return m.rows == 0 && m.columns == 0 && m.column_pointers.empty() && m.row_indices.empty() &&
         m.values.empty();
}

// Sizes of rows and columns against which rounding is measured. Computed only if mirror images differ.
class RoundingOfQ {
 public:
  explicit RoundingOfQ(const SparseMatrixView& q) : q_(q) {}

  [[nodiscard]] bool explains(double difference, Index i, Index j) {
    if (largest_.empty()) measure();
    return std::abs(difference) <= contract::symmetry * std::sqrt(largest_[i]) * std::sqrt(largest_[j]);
  }

 private:
  void measure() {
    largest_.assign(static_cast<std::size_t>(q_.columns), 0.0);
    for (Index column = 0; column < q_.columns; ++column) {
      for (Index k = q_.column_pointers[column]; k < q_.column_pointers[column + 1]; ++k) {
        const double size = std::abs(q_.values[k]);
        for (const Index of : {q_.row_indices[k], column}) largest_[of] = std::max(largest_[of], size);
      }
    }
  }

  const SparseMatrixView& q_;
  std::vector<double> largest_;  // largest |entry| of row or column i
};

// Checks in one sweep over the columns. Rows ascend, so the mirror image of the next entry below the diagonal
// of column r is always the next unread entry of that column.
Expected<void> check_symmetry(const SparseMatrixView& q, HessianForm form) {
  const auto asymmetric = [&](Index k, Index row, Index column, double mirror) {
    return unexpected(invalid("Q.values", k, text_of(q.values[k]),
                              "Q must be symmetric: entry (" + std::to_string(row) + ", " +
                                  std::to_string(column) + ") differs from its mirror image " +
                                  text_of(mirror)));
  };
  if (q.values.empty()) return {};
  RoundingOfQ rounding(q);
  const auto needs_mirror = [&](Index k, Index column) {
    return q.values[k] != 0.0 && !rounding.explains(q.values[k], q.row_indices[k], column);
  };
  std::vector<Index> next(q.column_pointers.begin(), q.column_pointers.end() - 1);
  for (Index column = 0; column < q.columns; ++column) {
    for (Index k = q.column_pointers[column]; k < q.column_pointers[column + 1]; ++k) {
      const Index row = q.row_indices[k];
      if (form == HessianForm::upper_triangle) {
        if (row > column) {
          return unexpected(
              invalid("Q.row_indices", k, std::to_string(row),
                      "must be <= " + std::to_string(column) + " (its column): upper triangle only"));
        }
        continue;
      }
      if (row >= column) break;
      Index& mirror = next[row];
      // Entries of column `row` above or on its diagonal were matched when those columns were visited.
      // Entries that rounding explains need no mirror image.
      while (
          mirror < q.column_pointers[row + 1] &&
          (q.row_indices[mirror] <= row || (q.row_indices[mirror] < column && !needs_mirror(mirror, row)))) {
        ++mirror;
      }
      if (mirror < q.column_pointers[row + 1] && q.row_indices[mirror] < column) {
        return asymmetric(mirror, q.row_indices[mirror], row, 0.0);
      }
      const bool present = mirror < q.column_pointers[row + 1] && q.row_indices[mirror] == column;
      const double below = present ? q.values[mirror] : 0.0;
      if (q.values[k] != below && !rounding.explains(q.values[k] - below, row, column))
        return asymmetric(k, row, column, below);
      if (present) ++mirror;
    }
  }
  if (form == HessianForm::upper_triangle) return {};
  for (Index column = 0; column < q.columns; ++column) {  // below the diagonal, without a match above it
    for (Index k = next[column]; k < q.column_pointers[column + 1]; ++k) {
      if (q.row_indices[k] > column && needs_mirror(k, column))
        return asymmetric(k, q.row_indices[k], column, 0.0);
    }
  }
  return {};
}

}  // namespace

Expected<void> check_matrix(const SparseMatrixView& m, const std::string& name, std::size_t rows,
                            std::size_t n, const char* rows_rule, MayBeEmpty may_be_empty) {
  if (is_empty(m) && (rows == 0 || may_be_empty == MayBeEmpty::always)) return {};
  const auto number = [](auto value) { return std::to_string(value); };
  if (m.rows < 0 || static_cast<std::size_t>(m.rows) != rows) {
    return unexpected(
        invalid(name + ".rows", number(m.rows), "must be " + number(rows) + " (" + rows_rule + ")"));
  }
  if (m.columns < 0 || static_cast<std::size_t>(m.columns) != n) {
    return unexpected(invalid(name + ".columns", number(m.columns), "must be " + number(n) + " (variables)"));
  }
  if (m.column_pointers.size() != n + 1) {
    return unexpected(invalid(name + ".column_pointers", number(m.column_pointers.size()) + " entries",
                              "must have " + number(n + 1) + " entries (columns + 1)"));
  }
  if (m.row_indices.size() != m.values.size()) {
    return unexpected(
        invalid(name + ".values", number(m.values.size()) + " entries",
                "must have " + number(m.row_indices.size()) + " entries, as many as row_indices"));
  }
  if (m.values.size() > static_cast<std::size_t>(std::numeric_limits<Index>::max())) {
    return unexpected(
        invalid(name + ".values", number(m.values.size()) + " entries", "must have less than 2^31"));
  }
  const auto entries = static_cast<Index>(m.values.size());
  if (m.column_pointers[0] != 0) {
    return unexpected(invalid(name + ".column_pointers", 0, number(m.column_pointers[0]), "must be 0"));
  }
  for (std::size_t j = 0; j < n; ++j) {
    const Index begin = m.column_pointers[j];
    const Index end = m.column_pointers[j + 1];
    if (end < begin || end > entries) {
      return unexpected(invalid(name + ".column_pointers", static_cast<std::int64_t>(j) + 1, number(end),
                                "must be in [" + number(begin) + ", " + number(entries) + "]"));
    }
    for (Index k = begin; k < end; ++k) {
      const Index row = m.row_indices[k];
      if (row < 0 || row >= m.rows) {
        return unexpected(
            invalid(name + ".row_indices", k, number(row), "must be in [0, " + number(rows) + ")"));
      }
      if (k > begin && row <= m.row_indices[k - 1]) {
        return unexpected(invalid(name + ".row_indices", k, number(row),
                                  "must be greater than the entry before it in column " + number(j)));
      }
    }
  }
  if (m.column_pointers[n] != entries) {
    return unexpected(invalid(name + ".column_pointers", static_cast<std::int64_t>(n),
                              number(m.column_pointers[n]), "must be " + number(entries) + " (entries)"));
  }
  return check_finite(m.values, name + ".values");
}

Expected<Problem> Problem::create(const ProblemView& view) {
  const std::size_t n = view.g.size();
  if (n == 0)
    return unexpected(invalid("g", "0 entries", "must have at least 1 entry: there must be a variable"));
  const struct {
    const char* name;
    std::span<const double> values;
  } vectors[] = {
#define MARBLE_VECTOR(letter, field) {#letter, view.letter},
#include "marble/contract.def"
  };
  for (const auto& vector : vectors) {
    if (vector.values.size() > contract::most_rows) {
      return unexpected(invalid(vector.name, std::to_string(vector.values.size()) + " entries",
                                "must have at most " + std::to_string(contract::most_rows) + " entries"));
    }
  }
  if (view.r.size() != view.l.size()) {
    return unexpected(invalid("r", std::to_string(view.r.size()) + " entries",
                              "must have " + std::to_string(view.l.size()) + " entries, as many as l"));
  }
  const struct {
    const char* name;
    const SparseMatrixView& matrix;
    std::size_t rows;
    const char* rule;
  } matrices[] = {
#define MARBLE_MATRIX(letter, field, update, vector) \
  {#letter, view.letter, view.vector.size(), "entries of " #vector},
#include "marble/contract.def"
  };
  for (const auto& m : matrices) {
    const bool is_q = &m.matrix == &view.Q;
    MARBLE_RETURN_IF_ERROR(check_matrix(m.matrix, m.name, m.rows, n, is_q ? "variables" : m.rule,
                                        is_q ? MayBeEmpty::always : MayBeEmpty::without_rows));
  }
  for (const auto& vector : vectors) {
    MARBLE_RETURN_IF_ERROR(check_finite(vector.values, vector.name));
  }
  if (!std::isfinite(view.c0)) return unexpected(invalid("c0", text_of(view.c0), "must be finite"));
  MARBLE_RETURN_IF_ERROR(check_symmetry(view.Q, view.hessian_form));
  return Problem(view);
}

Expected<void> Problem::check_initial_point(std::span<const double> z, Index variables) {
  if (z.empty()) return {};
  return check_numbers(z, static_cast<std::size_t>(variables), "initial_z");
}

Expected<void> check_numbers(std::span<const double> values, std::size_t size, const char* field) {
  if (values.size() != size) {
    return unexpected(invalid(field, std::to_string(values.size()) + " entries",
                              "must have " + std::to_string(size) + " entries"));
  }
  return check_finite(values, field);
}

Expected<SparseMatrix> compress(Index rows, Index columns, const Triplets& entries, const char* name) {
  const std::string prefix = name;
  if (rows < 0) return unexpected(invalid(prefix + ".rows", std::to_string(rows), "must be >= 0"));
  if (columns < 0) return unexpected(invalid(prefix + ".cols", std::to_string(columns), "must be >= 0"));
  const std::size_t count = entries.values.size();
  if (count > static_cast<std::size_t>(std::numeric_limits<Index>::max())) {
    return unexpected(invalid(prefix + ".v", std::to_string(count) + " entries", "must have less than 2^31"));
  }
  if (entries.rows.size() != count) {
    return unexpected(invalid(prefix + ".i", std::to_string(entries.rows.size()) + " entries",
                              "must have " + std::to_string(count) + " entries, as many as v"));
  }
  if (entries.columns.size() != count) {
    return unexpected(invalid(prefix + ".j", std::to_string(entries.columns.size()) + " entries",
                              "must have " + std::to_string(count) + " entries, as many as v"));
  }
  const auto check_range = [](const std::vector<Index>& indices, Index end,
                              const std::string& field) -> Expected<void> {
    for (std::size_t k = 0; k < indices.size(); ++k) {
      if (indices[k] < 0 || indices[k] >= end) {
        return unexpected(invalid(field, static_cast<std::int64_t>(k), std::to_string(indices[k]),
                                  "must be in [0, " + std::to_string(end) + ")"));
      }
    }
    return {};
  };
  MARBLE_RETURN_IF_ERROR(check_range(entries.rows, rows, prefix + ".i"));
  MARBLE_RETURN_IF_ERROR(check_range(entries.columns, columns, prefix + ".j"));
  MARBLE_RETURN_IF_ERROR(check_finite(entries.values, prefix + ".v"));

  // Sorts by columns in one pass, then each column by rows; duplicates keep their order.
  std::vector<Index> ends(static_cast<std::size_t>(columns) + 1, 0), order(count);
  for (const Index column : entries.columns) ++ends[static_cast<std::size_t>(column) + 1];
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  for (std::size_t k = 0; k < count; ++k)
    order[static_cast<std::size_t>(ends[static_cast<std::size_t>(entries.columns[k])]++)] =
        static_cast<Index>(k);
  const auto by_rows = [&](Index a, Index b) { return entries.rows[a] < entries.rows[b]; };
  for (Index column = 0, begin = 0; column < columns; ++column) {  // each begins where the previous ends
    const Index end = ends[static_cast<std::size_t>(column)];
    if (!std::is_sorted(order.begin() + begin, order.begin() + end, by_rows))
      std::stable_sort(order.begin() + begin, order.begin() + end, by_rows);
    begin = end;
  }
  SparseMatrix result;
  result.rows = rows;
  result.columns = columns;
  result.column_pointers.assign(static_cast<std::size_t>(columns) + 1, 0);
  Index last_row = -1;
  Index last_column = -1;
  for (const Index k : order) {
    if (entries.rows[k] == last_row && entries.columns[k] == last_column) {
      result.values.back() += entries.values[k];
      if (!std::isfinite(result.values.back())) {
        return unexpected(invalid(prefix + ".v", k, text_of(entries.values[k]),
                                  "must leave the sum of the entries at its place finite"));
      }
      continue;
    }
    last_row = entries.rows[k];
    last_column = entries.columns[k];
    result.row_indices.push_back(last_row);
    result.values.push_back(entries.values[k]);
    ++result.column_pointers[last_column + 1];
  }
  std::partial_sum(result.column_pointers.begin(), result.column_pointers.end(),
                   result.column_pointers.begin());
  return result;
}

PartSizes PartSizes::of(const Problem& problem) {
  const ProblemView& view = problem.view();
  PartSizes sizes;
#define MARBLE_VECTOR(letter, field) sizes.letter = view.letter.size();
#define MARBLE_MATRIX(letter, field, update, vector) sizes.letter = view.letter.values.size();
#include "marble/contract.def"
  return sizes;
}

Expected<void> PartSizes::check(const ProblemUpdate& update) const {
  const struct {
    const char* field;
    std::span<const double> values;
    std::size_t size;
  } parts[] = {
#define MARBLE_VECTOR(letter, field) {#letter, update.letter, letter},
#define MARBLE_MATRIX(letter, field, values, vector) {#letter ".values", update.letter, letter},
#include "marble/contract.def"
  };
  if (update.c0) {
    if (auto valid = check_numbers({&*update.c0, 1}, 1, "c0"); !valid) {
      valid.error().index = -1;
      return valid;
    }
  }
  for (const auto& part : parts) {
    if (part.values.empty()) continue;
    MARBLE_RETURN_IF_ERROR(check_numbers(part.values, part.size, part.field));
  }
  return {};
}

}  // namespace marble
