// Evaluates functions of an .nl file and their derivatives with AMPL's library (ASL); the only file that uses
// it.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble::formats {

/// Has n variables and m rows. An undefined value at a point is NaN. Not thread-safe.
class AslFunctions {
 public:
  /// Opens a file that read_expressions() wrote. Errors: internal (the library rejects it),
  /// resource_exhausted (no space for a temporary file, no memory).
  [[nodiscard]] static Expected<AslFunctions> open(const std::string& content);
  AslFunctions(AslFunctions&&) noexcept;
  AslFunctions& operator=(AslFunctions&&) noexcept;
  ~AslFunctions();

  [[nodiscard]] double objective(std::span<const double> x);
  void rows(std::span<const double> x, std::span<double> values);
  [[nodiscard]] double row(std::size_t index, std::span<const double> x);
  void gradient(std::span<const double> x, std::span<double> values);

  /// m × n, with a fixed pattern; rows ascend within a column.
  [[nodiscard]] const SparseMatrix& jacobian(std::span<const double> x);
  /// ∇²(weight · objective + Σ y_i row_i), n × n, its upper triangle with a fixed pattern; rows ascend.
  [[nodiscard]] const SparseMatrix& hessian(std::span<const double> x, double weight,
                                            std::span<const double> y);

 private:
  struct Library;
  explicit AslFunctions(std::unique_ptr<Library> library);
  std::unique_ptr<Library> library_;
};

}  // namespace marble::formats
