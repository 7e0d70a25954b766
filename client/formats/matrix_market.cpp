#include "matrix_market.h"

#include <cholmod.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "tables.h"

namespace marble::formats {
namespace {

constexpr const char* kParts[] = {"Q", "g", "A", "b", "C", "d", "L", "l", "R", "r", "c0", "x0"};

class Cholmod {
 public:
  Cholmod() {
    cholmod_start(&common_);
    common_.print = 0;  // it must not talk to the terminal
    common_.error_handler = nullptr;
    common_.prefer_upper = 0;
  }
  ~Cholmod() { cholmod_finish(&common_); }
  Cholmod(const Cholmod&) = delete;
  Cholmod& operator=(const Cholmod&) = delete;
  [[nodiscard]] cholmod_common* common() { return &common_; }

 private:
  cholmod_common common_;
};

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

Error fault(const std::string& part, const std::string& bound) {
  return {ErrorCode::invalid_argument, part, -1, "", bound};
}

TableMatrix table_of(const cholmod_dense& dense) {
  TableMatrix table{static_cast<Index>(dense.nrow), static_cast<Index>(dense.ncol)};
  const auto* values = static_cast<const double*>(dense.x);
  for (std::size_t column = 0; column < dense.ncol; ++column) {
    for (std::size_t row = 0; row < dense.nrow; ++row) {
      const double value = values[column * dense.d + row];
      if (value != 0.0) table.entries.add(static_cast<Index>(row), static_cast<Index>(column), value);
    }
  }
  return table;
}

TableMatrix table_of(const cholmod_triplet& triplet) {
  TableMatrix table{static_cast<Index>(triplet.nrow), static_cast<Index>(triplet.ncol)};
  const auto* rows = static_cast<const int*>(triplet.i);
  const auto* columns = static_cast<const int*>(triplet.j);
  const auto* values = static_cast<const double*>(triplet.x);
  for (std::size_t k = 0; k < triplet.nnz; ++k) {
    table.entries.add(rows[k], columns[k], values[k]);
    if (triplet.stype != 0 && rows[k] != columns[k]) table.entries.add(columns[k], rows[k], values[k]);
  }
  return table;
}

Expected<std::optional<TableMatrix>> read_part(const std::string& folder, const char* part) {
  const std::string path = (std::filesystem::path(folder) / part).string() + ".mtx";
  if (!std::filesystem::exists(path)) return std::nullopt;
  const File file(std::fopen(path.c_str(), "re"), &std::fclose);
  if (file == nullptr) return unexpected(Error{ErrorCode::not_found, part, -1, "", "cannot be read"});
  Cholmod cholmod;
  int kind = CHOLMOD_SPARSE;
  constexpr int kTriplets = 0;
  void* read = cholmod_read_matrix(file.get(), kTriplets, &kind, cholmod.common());
  if (read == nullptr) return unexpected(fault(part, "is no Matrix Market file that could be read"));
  std::optional<TableMatrix> table;
  if (kind == CHOLMOD_DENSE) {
    auto* dense = static_cast<cholmod_dense*>(read);
    if (dense->xtype == CHOLMOD_REAL) table = table_of(*dense);
    cholmod_free_dense(&dense, cholmod.common());
  } else if (kind == CHOLMOD_TRIPLET) {
    auto* triplet = static_cast<cholmod_triplet*>(read);
    if (triplet->xtype == CHOLMOD_REAL) table = table_of(*triplet);
    cholmod_free_triplet(&triplet, cholmod.common());
  } else {
    auto* sparse = static_cast<cholmod_sparse*>(read);
    cholmod_free_sparse(&sparse, cholmod.common());
  }
  if (!table) return unexpected(fault(part, "must hold real numbers"));
  return table;
}

Expected<void> write_file(const std::string& path,
                          const std::function<bool(std::FILE*, cholmod_common*)>& write) {
  std::FILE* file = std::fopen(path.c_str(), "we");
  Cholmod cholmod;
  const bool written = file != nullptr && write(file, cholmod.common());
  const bool closed = file != nullptr && std::fclose(file) == 0;
  if (written && closed) return {};
  return unexpected(Error{ErrorCode::unavailable, "", -1, path, "cannot be written"});
}

// CHOLMOD writes what it is lent and changes nothing. It takes no null for an array without entries.
template <class T>
T* lent(const std::vector<T>& values) {
  static T nothing = {};
  return values.empty() ? &nothing : const_cast<T*>(values.data());
}

}  // namespace

Expected<ProblemFile> read_matrix_market(const std::string& folder, const std::string& name) {
  return assemble_tables([&](const char* part) { return read_part(folder, part); }, name);
}

Expected<void> write_matrix_market(const ProblemFile& file, const std::string& folder) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed)
    return unexpected(Error{ErrorCode::unavailable, "", -1, folder, "cannot be made: " + failed.message()});
  const auto path = [&](const char* part) {
    return (std::filesystem::path(folder) / part).string() + ".mtx";
  };
  for (const char* part : kParts) std::filesystem::remove(path(part), failed);
  TableSink sink;
  sink.matrix = [&](const char* part, const SparseMatrix& matrix) {
    cholmod_sparse sparse = {};
    sparse.nrow = static_cast<std::size_t>(matrix.rows);
    sparse.ncol = static_cast<std::size_t>(matrix.columns);
    sparse.nzmax = matrix.values.size();
    sparse.p = lent(matrix.column_pointers);
    sparse.i = lent(matrix.row_indices);
    sparse.x = lent(matrix.values);
    sparse.itype = CHOLMOD_INT;
    sparse.xtype = CHOLMOD_REAL;
    sparse.dtype = CHOLMOD_DOUBLE;
    sparse.sorted = sparse.packed = 1;
    return write_file(path(part), [&](std::FILE* out, cholmod_common* common) {
      return cholmod_write_sparse(out, &sparse, nullptr, nullptr, common) >= 0;
    });
  };
  sink.vector = [&](const char* part, const std::vector<double>& vector) {
    cholmod_dense dense = {};
    dense.nrow = dense.nzmax = dense.d = vector.size();
    dense.ncol = 1;
    dense.x = lent(vector);
    dense.xtype = CHOLMOD_REAL;
    dense.dtype = CHOLMOD_DOUBLE;
    return write_file(path(part), [&](std::FILE* out, cholmod_common* common) {
      return cholmod_write_dense(out, &dense, nullptr, common) >= 0;
    });
  };
  return write_tables(file, sink);
}

}  // namespace marble::formats
