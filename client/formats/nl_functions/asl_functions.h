// Functions of an .nl file and their derivatives, by AMPL's library (ASL): the only file that knows it.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/problem.h"

namespace marble::formats {

/// n variables, m rows. What has no value at a point is NaN there. Not for several threads at a time.
class AslFunctions {
 public:
  /// Of a file that read_expressions() wrote. Errors: internal (the library does not take it),
  /// resource_exhausted (no place for a temporary file, no memory).
  [[nodiscard]] static Expected<AslFunctions> open(const std::string& content);
  AslFunctions(AslFunctions&&) noexcept;
  AslFunctions& operator=(AslFunctions&&) noexcept;
  ~AslFunctions();

  [[nodiscard]] double objective(std::span<const double> x);
  void rows(std::span<const double> x, std::span<double> values);
  [[nodiscard]] double row(std::size_t index, std::span<const double> x);
  void gradient(std::span<const double> x, std::span<double> values);

  /// m × n, its pattern fixed; rows ascend within a column.
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
