#include "mat_problem.h"

#include <matio.h>

#include <memory>

#include "assembler.h"
#include "lcqpow_problem.h"

namespace marble::formats {
namespace {

struct CloseFile {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using Variable = std::unique_ptr<matvar_t, FreeVariable>;

Error fault(const std::string& variable, const std::string& value, const std::string& bound) {
  return {ErrorCode::invalid_argument, variable, -1, value, bound};
}

void read_sparse(const matvar_t& variable, TableMatrix& matrix) {
  const auto& sparse = *static_cast<const mat_sparse_t*>(variable.data);
  const auto* values = static_cast<const double*>(sparse.data);
  for (std::size_t column = 0; column + 1 < sparse.njc; ++column) {
    for (auto k = sparse.jc[column]; k < sparse.jc[column + 1]; ++k)
      matrix.entries.add(static_cast<Index>(sparse.ir[k]), static_cast<Index>(column), values[k]);
  }
}

void read_dense(const matvar_t& variable, TableMatrix& matrix) {
  const auto* values = static_cast<const double*>(variable.data);
  const auto rows = static_cast<std::size_t>(matrix.rows);
  for (std::size_t k = 0; k < rows * static_cast<std::size_t>(matrix.columns); ++k) {
    if (values[k] != 0.0)
      matrix.entries.add(static_cast<Index>(k % rows), static_cast<Index>(k / rows), values[k]);
  }
}

Expected<std::optional<TableMatrix>> read_variable(mat_t* file, const char* name) {
  const Variable variable(Mat_VarRead(file, name));
  if (variable == nullptr) return std::nullopt;
  constexpr std::size_t kMost = 0x7fffffff;
  if (variable->rank != 2 || variable->dims[0] > kMost || variable->dims[1] > kMost)
    return unexpected(fault(name, "", "must be a matrix or a vector with less than 2^31 rows and columns"));
  if (variable->isComplex != 0) return unexpected(fault(name, "complex", "must be real"));
  TableMatrix matrix;
  matrix.rows = static_cast<Index>(variable->dims[0]);
  matrix.columns = static_cast<Index>(variable->dims[1]);
  if (matrix.rows == 0 || matrix.columns == 0) return matrix;
  const bool sparse = variable->class_type == MAT_C_SPARSE;
  const bool numbers = variable->data_type == MAT_T_DOUBLE && variable->data != nullptr;
  if (!numbers || !(sparse || variable->class_type == MAT_C_DOUBLE))
    return unexpected(fault(name, "", "must be of class double, full or sparse"));
  if (sparse) {
    read_sparse(*variable, matrix);
  } else {
    read_dense(*variable, matrix);
  }
  return matrix;
}

}  // namespace

Expected<ProblemFile> read_mat(const std::string& path, const std::string& name) {
  const std::unique_ptr<mat_t, CloseFile> file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (file == nullptr)
    return unexpected(Error{ErrorCode::not_found, "", -1, "", "cannot be read as a MATLAB file"});
  const auto read = [&](const char* variable) { return read_variable(file.get(), variable); };
  return assemble_lcqpow(read, name);
}

}  // namespace marble::formats
