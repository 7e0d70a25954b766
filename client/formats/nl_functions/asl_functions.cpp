#include "nl_functions/asl_functions.h"

#include <fenv.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <numeric>

#include "asl_pfgh.h"  // last: it defines macros of short names
#undef filename

namespace marble::formats {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The library leaves by longjmp where there is an error, past C alone: `call` must hold nothing to destroy.
// False where it did.
template <class Call>
bool reaches_end(ASL* asl, const Call& call) {
  Jmp_buf back;
  if (setjmp(back.jb) != 0) {
    asl->i.err_jmp_ = asl->i.err_jmp1_ = nullptr;
    asl->i.x0kind_ = ASL_first_x;  // what it knows of the point may be half of it
    return false;
  }
  asl->i.err_jmp_ = asl->i.err_jmp1_ = &back;
  call();
  asl->i.err_jmp_ = asl->i.err_jmp1_ = nullptr;
  return true;
}

// The library sets the precision of the processor's extended numbers when it opens a file.
class KeptFloatingPoint {
 public:
  KeptFloatingPoint() { fegetenv(&environment_); }
  ~KeptFloatingPoint() { fesetenv(&environment_); }
  KeptFloatingPoint(const KeptFloatingPoint&) = delete;
  KeptFloatingPoint& operator=(const KeptFloatingPoint&) = delete;

 private:
  fenv_t environment_ = {};
};

// The library opens files by their name alone.
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
      return unexpected(failure(ErrorCode::unavailable, folder.string() + ": cannot hold a temporary file"));
    }
    std::size_t written = 0;
    for (ssize_t now = 1; written < content.size() && now > 0; written += static_cast<std::size_t>(now))
      now = std::max<ssize_t>(write(descriptor, content.data() + written, content.size() - written), 0);
    if (close(descriptor) == 0 && written == content.size()) return file;
    return unexpected(failure(ErrorCode::unavailable, folder.string() + ": cannot hold a temporary file"));
  }
  TemporaryFile(TemporaryFile&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  TemporaryFile& operator=(TemporaryFile&&) = delete;
  ~TemporaryFile() {
    if (!path_.empty()) unlink(path_.c_str());
  }
  /// Without its ending.
  [[nodiscard]] std::string stub() const { return path_.substr(0, path_.size() - 3); }

 private:
  TemporaryFile() = default;
  std::string path_;
};

}  // namespace

struct AslFunctions::Library {
  ASL* asl = nullptr;
  std::size_t n = 0, m = 0;
  SparseMatrix jacobian, hessian;
  std::vector<double> given;       ///< second derivatives in the library's order
  std::vector<std::size_t> order;  ///< of the hessian's entries: where they are in `given`
  std::vector<double> rows, y;     ///< scratch

  Library() = default;
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library() {
    if (asl != nullptr) ASL_free(&asl);
  }

  [[nodiscard]] Expected<void> read(const std::string& content);
  void take_jacobian();
  void take_hessian();

  // It takes the point by a pointer to what is not constant, and leaves it.
  static real* point(std::span<const double> x) { return const_cast<real*>(x.data()); }
  [[nodiscard]] double objective(std::span<const double> x) const {
    fint failed = 0;
    double value = kNaN;
    const bool came = reaches_end(asl, [&] { value = asl->p.Objval(asl, 0, point(x), &failed); });
    return came && failed == 0 ? value : forgotten();
  }
  [[nodiscard]] bool all_rows(std::span<const double> x, std::span<double> values) const {
    if (m == 0) return true;
    fint failed = 0;
    const bool came = reaches_end(asl, [&] { asl->p.Conval(asl, point(x), values.data(), &failed); });
    if (came && failed == 0) return true;
    static_cast<void>(forgotten());
    return false;
  }
  [[nodiscard]] double row(int index, std::span<const double> x) const {
    fint failed = 0;
    double value = kNaN;
    const bool came = reaches_end(asl, [&] { value = asl->p.Conival(asl, index, point(x), &failed); });
    return came && failed == 0 ? value : forgotten();
  }
  // What the library knows of the point may be half of it.
  [[nodiscard]] double forgotten() const {
    asl->i.x0kind_ = ASL_first_x;
    return kNaN;
  }
};

Expected<void> AslFunctions::Library::read(const std::string& content) {
  auto file = TemporaryFile::of(content);
  if (!file) return unexpected(file.error());
  const std::string stub = file->stub();
  const KeptFloatingPoint kept;
  asl = ASL_alloc(ASL_read_pfgh);
  if (asl == nullptr)
    return unexpected(failure(ErrorCode::resource_exhausted, "no memory for the functions"));
  asl->i.return_nofile_ = 3;  // neither a missing file nor a faulty header ends the process
  FILE* stream = nullptr;
  int fault = 0;
  const bool came = reaches_end(asl, [&] {
    stream = jac0dim_ASL(asl, stub.c_str(), static_cast<ftnlen>(stub.size()));
    if (stream != nullptr) fault = pfgh_read_ASL(asl, stream, ASL_return_read_err);
  });
  if (!came || stream == nullptr || fault != 0)
    return unexpected(failure(ErrorCode::internal,
                              "AMPL's library does not take the model, error " + std::to_string(fault)));
  n = static_cast<std::size_t>(asl->i.n_var_), m = static_cast<std::size_t>(asl->i.n_con_);
  rows.resize(m), y.resize(m);
  take_jacobian();
  fint entries = 0;
  const bool set = reaches_end(asl, [&] { entries = asl->p.Sphset(asl, nullptr, -1, 1, m > 0 ? 1 : 0, 1); });
  if (!set) return unexpected(failure(ErrorCode::internal, "AMPL's library has no second derivatives"));
  given.resize(static_cast<std::size_t>(entries));
  take_hessian();
  return {};
}

void AslFunctions::Library::take_jacobian() {
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
  const SputInfo& pattern = *asl->i.sputinfo_;
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
  if (auto read = library->read(content); !read) return unexpected(read.error());
  return AslFunctions(std::move(library));
}

double AslFunctions::objective(std::span<const double> x) { return library_->objective(x); }

void AslFunctions::rows(std::span<const double> x, std::span<double> values) {
  if (library_->all_rows(x, values)) return;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = library_->row(static_cast<int>(i), x);
}

void AslFunctions::gradient(std::span<const double> x, std::span<double> values) {
  ASL* const asl = library_->asl;
  fint failed = 0;
  const bool came =
      reaches_end(asl, [&] { asl->p.Objgrd(asl, 0, Library::point(x), values.data(), &failed); });
  if (!came || failed != 0) std::ranges::fill(values, library_->forgotten());
}

const SparseMatrix& AslFunctions::jacobian(std::span<const double> x) {
  Library& of = *library_;
  if (of.m == 0) return of.jacobian;
  fint failed = 0;
  const bool came = reaches_end(
      of.asl, [&] { of.asl->p.Jacval(of.asl, Library::point(x), of.jacobian.values.data(), &failed); });
  if (!came || failed != 0) std::ranges::fill(of.jacobian.values, of.forgotten());
  return of.jacobian;
}

const SparseMatrix& AslFunctions::hessian(std::span<const double> x, double weight,
                                          std::span<const double> y) {
  Library& of = *library_;
  static_cast<void>(of.objective(x));  // so it knows the point
  bool came = of.all_rows(x, of.rows);
  std::ranges::copy(y, of.y.begin());
  came = came && reaches_end(of.asl, [&] {
           of.asl->p.Sphes(of.asl, nullptr, of.given.data(), -1, &weight, of.m > 0 ? of.y.data() : nullptr);
         });
  if (!came) std::ranges::fill(of.given, of.forgotten());
  for (std::size_t k = 0; k < of.order.size(); ++k) of.hessian.values[k] = of.given[of.order[k]];
  return of.hessian;
}

}  // namespace marble::formats
