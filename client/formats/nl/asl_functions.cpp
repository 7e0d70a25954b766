#include "nl/asl_functions.h"

#include <fenv.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <numeric>

#include "asl_pfgh.h"  // last: it defines macros of short names
#undef filename

namespace marble::formats {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The library reports errors by longjmp, over C frames only: `call` must hold nothing with a destructor.
// Returns false on an error.
template <class Call>
bool reaches_end(ASL* asl, const Call& call) {
  Jmp_buf back;
  if (setjmp(back.jb) != 0) {
    asl->i.err_jmp_ = asl->i.err_jmp1_ = nullptr;
    asl->i.x0kind_ = ASL_first_x;  // its state for the point may be incomplete
    return false;
  }
  asl->i.err_jmp_ = asl->i.err_jmp1_ = &back;
  call();
  asl->i.err_jmp_ = asl->i.err_jmp1_ = nullptr;
  return true;
}

// The library sets the precision of the processor's extended numbers when it opens a file; this restores it.
class KeptFloatingPoint {
 public:
  KeptFloatingPoint() { fegetenv(&environment_); }
  ~KeptFloatingPoint() { fesetenv(&environment_); }
  KeptFloatingPoint(const KeptFloatingPoint&) = delete;
  KeptFloatingPoint& operator=(const KeptFloatingPoint&) = delete;

 private:
  fenv_t environment_ = {};
};

// The library opens files only by name.
class TemporaryFile {
 public:
  [[nodiscard]] static Expected<TemporaryFile> of(const std::string& content) {
    std::error_code failed;
    auto folder = std::filesystem::temp_directory_path(failed);
    if (failed) folder = "/tmp";
    TemporaryFile file;
    file.path_ = (folder / "marble-XXXXXX.nl").string();
    const int descriptor = mkstemps(file.path_.data(), 3);
    if (descriptor < 0) {
      file.path_.clear();
      return unexpected(
          failure(ErrorCode::resource_exhausted, folder.string() + ": cannot hold a temporary file"));
    }
    std::size_t written = 0;
    for (ssize_t now = 1; written < content.size() && now > 0; written += static_cast<std::size_t>(now))
      now = std::max<ssize_t>(write(descriptor, content.data() + written, content.size() - written), 0);
    if (close(descriptor) == 0 && written == content.size()) return file;
    return unexpected(
        failure(ErrorCode::resource_exhausted, folder.string() + ": cannot hold a temporary file"));
  }
  TemporaryFile(TemporaryFile&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  TemporaryFile& operator=(TemporaryFile&&) = delete;
  ~TemporaryFile() {
    if (!path_.empty()) unlink(path_.c_str());
  }
  /// Returns the path without the extension.
  [[nodiscard]] std::string stub() const { return path_.substr(0, path_.size() - 3); }

 private:
  TemporaryFile() = default;
  std::string path_;
};

// One loaded copy of the file. The library takes a point by a non-const pointer, but does not change it.
class Reading {
 public:
  Reading() = default;
  Reading(const Reading&) = delete;
  Reading& operator=(const Reading&) = delete;
  ~Reading() {
    if (asl_ != nullptr) ASL_free(&asl_);
  }

  [[nodiscard]] Expected<void> read(const std::string& stub, int kind) {
    asl_ = ASL_alloc(kind);
    if (asl_ == nullptr)
      return unexpected(failure(ErrorCode::resource_exhausted, "no memory for the functions"));
    asl_->i.return_nofile_ = 3;  // neither a missing file nor an invalid header ends the process
    FILE* stream = nullptr;
    int fault = 0;
    const bool came = reaches_end(asl_, [&] {
      stream = jac0dim_ASL(asl_, stub.c_str(), static_cast<ftnlen>(stub.size()));
      if (stream == nullptr) return;
      fault = kind == ASL_read_fg ? fg_read_ASL(asl_, stream, ASL_return_read_err)
                                  : pfgh_read_ASL(asl_, stream, ASL_return_read_err);
    });
    if (came && stream != nullptr && fault == 0) return {};
    return unexpected(failure(ErrorCode::internal,
                              "AMPL's library does not take the model, error " + std::to_string(fault)));
  }
  [[nodiscard]] ASL* asl() const { return asl_; }
  [[nodiscard]] std::size_t columns() const { return static_cast<std::size_t>(asl_->i.n_var_); }
  [[nodiscard]] std::size_t rows() const { return static_cast<std::size_t>(asl_->i.n_con_); }

  static real* point(std::span<const double> x) { return const_cast<real*>(x.data()); }
  [[nodiscard]] double objective(std::span<const double> x) const {
    double value = kNaN;
    return asked([&](fint* failed) { value = asl_->p.Objval(asl_, 0, point(x), failed); }) ? value : kNaN;
  }
  [[nodiscard]] bool all_rows(std::span<const double> x, std::span<double> values) const {
    return rows() == 0 || asked([&](fint* failed) { asl_->p.Conval(asl_, point(x), values.data(), failed); });
  }
  [[nodiscard]] double row(int index, std::span<const double> x) const {
    double value = kNaN;
    return asked([&](fint* failed) { value = asl_->p.Conival(asl_, index, point(x), failed); }) ? value
                                                                                                : kNaN;
  }
  /// Returns whether the library evaluated `ask`; on failure it discards the point, whose state may be
  /// incomplete.
  template <class Ask>
  [[nodiscard]] bool asked(const Ask& ask) const {
    fint failed = 0;
    if (reaches_end(asl_, [&] { ask(&failed); }) && failed == 0) return true;
    asl_->i.x0kind_ = ASL_first_x;
    return false;
  }

 private:
  ASL* asl_ = nullptr;
};

}  // namespace

struct AslFunctions::Library {
  Reading first, second;  ///< derivatives: the copy for second ones sometimes has wrong first ones
  std::size_t n = 0, m = 0;
  SparseMatrix jacobian, hessian;
  std::vector<double> given;       ///< second derivatives in the library's order
  std::vector<std::size_t> order;  ///< positions of the hessian's entries in `given`
  std::vector<double> rows, y;     ///< scratch

  [[nodiscard]] Expected<void> read(const std::string& content);
  void take_jacobian();
  void take_hessian();
};

Expected<void> AslFunctions::Library::read(const std::string& content) {
  MARBLE_ASSIGN_OR_RETURN(auto file, TemporaryFile::of(content));
  const KeptFloatingPoint kept;
  MARBLE_RETURN_IF_ERROR(first.read(file.stub(), ASL_read_fg));
  MARBLE_RETURN_IF_ERROR(second.read(file.stub(), ASL_read_pfgh));
  n = first.columns(), m = first.rows();
  rows.resize(m), y.resize(m);
  take_jacobian();
  fint entries = 0;
  ASL* const asl = second.asl();
  if (!second.asked([&](fint*) { entries = asl->p.Sphset(asl, nullptr, -1, 1, m > 0 ? 1 : 0, 1); }))
    return unexpected(failure(ErrorCode::internal, "AMPL's library has no second derivatives"));
  given.resize(static_cast<std::size_t>(entries));
  take_hessian();
  return {};
}

void AslFunctions::Library::take_jacobian() {
  const ASL* const asl = first.asl();
  const auto entries = static_cast<std::size_t>(asl->i.nzc_);
  const auto rows_of = static_cast<Index>(m), columns = static_cast<Index>(n);
  jacobian = {rows_of, columns, std::vector<Index>(n + 1, 0), std::vector<Index>(entries, 0),
              std::vector<double>(entries, 0.0)};
  for (std::size_t i = 0; i < m; ++i) {
    for (const cgrad* entry = asl->i.Cgrad_[i]; entry != nullptr; entry = entry->next) {
      ++jacobian.column_pointers[static_cast<std::size_t>(entry->varno) + 1];
      jacobian.row_indices[static_cast<std::size_t>(entry->goff)] = static_cast<Index>(i);
    }
  }
  auto& pointers = jacobian.column_pointers;
  std::partial_sum(pointers.begin(), pointers.end(), pointers.begin());
}

void AslFunctions::Library::take_hessian() {
  const SputInfo& pattern = *second.asl()->i.sputinfo_;
  hessian = {static_cast<Index>(n), static_cast<Index>(n), {0}, {}, std::vector<double>(given.size(), 0.0)};
  order.resize(given.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t j = 0; j < n; ++j) {
    const auto begin = order.begin() + pattern.hcolstarts[j], end = order.begin() + pattern.hcolstarts[j + 1];
    std::sort(begin, end,
              [&](std::size_t a, std::size_t b) { return pattern.hrownos[a] < pattern.hrownos[b]; });
    for (auto entry = begin; entry != end; ++entry)
      hessian.row_indices.push_back(static_cast<Index>(pattern.hrownos[*entry]));
    hessian.column_pointers.push_back(static_cast<Index>(hessian.row_indices.size()));
  }
}

AslFunctions::AslFunctions(std::unique_ptr<Library> library) : library_(std::move(library)) {}
AslFunctions::AslFunctions(AslFunctions&&) noexcept = default;
AslFunctions& AslFunctions::operator=(AslFunctions&&) noexcept = default;
AslFunctions::~AslFunctions() = default;

Expected<AslFunctions> AslFunctions::open(const std::string& content) {
  auto library = std::make_unique<Library>();
  MARBLE_RETURN_IF_ERROR(library->read(content));
  return AslFunctions(std::move(library));
}

double AslFunctions::objective(std::span<const double> x) { return library_->first.objective(x); }

void AslFunctions::rows(std::span<const double> x, std::span<double> values) {
  if (library_->first.all_rows(x, values)) return;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = row(i, x);
}

double AslFunctions::row(std::size_t index, std::span<const double> x) {
  return library_->first.row(static_cast<int>(index), x);
}

// Evaluates values first: if the library does it itself, it prints missing values on standard error.
void AslFunctions::gradient(std::span<const double> x, std::span<double> values) {
  const Reading& of = library_->first;
  ASL* const asl = of.asl();
  const bool good = std::isfinite(of.objective(x)) && of.asked([&](fint* failed) {
    asl->p.Objgrd(asl, 0, Reading::point(x), values.data(), failed);
  });
  if (!good) std::ranges::fill(values, kNaN);
}

const SparseMatrix& AslFunctions::jacobian(std::span<const double> x) {
  Library& of = *library_;
  if (of.m == 0) return of.jacobian;
  ASL* const asl = of.first.asl();
  const bool good = of.first.all_rows(x, of.rows) && of.first.asked([&](fint* failed) {
    asl->p.Jacval(asl, Reading::point(x), of.jacobian.values.data(), failed);
  });
  if (!good) std::ranges::fill(of.jacobian.values, kNaN);
  return of.jacobian;
}

const SparseMatrix& AslFunctions::hessian(std::span<const double> x, double weight,
                                          std::span<const double> y) {
  Library& of = *library_;
  ASL* const asl = of.second.asl();
  std::ranges::copy(y, of.y.begin());
  const bool good =
      std::isfinite(of.second.objective(x)) && of.second.all_rows(x, of.rows) && of.second.asked([&](fint*) {
        asl->p.Sphes(asl, nullptr, of.given.data(), -1, &weight, of.m > 0 ? of.y.data() : nullptr);
      });
  if (!good) std::ranges::fill(of.given, kNaN);
  for (std::size_t k = 0; k < of.order.size(); ++k) of.hessian.values[k] = of.given[of.order[k]];
  return of.hessian;
}

}  // namespace marble::formats
