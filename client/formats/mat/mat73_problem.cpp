#include "mat/mat73_problem.h"

#include <fcntl.h>
#include <matio.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <span>

#include "mat/mat_file.h"
#include "parts/file_limits.h"

namespace marble::formats {
namespace {

constexpr std::size_t kLibraryBytes = std::size_t{256} << 20;  // for libmatio and HDF5 themselves
constexpr rlim_t kSeconds = 60;                                // of processor time, and one more per MiB

struct CloseFile {
  void operator()(mat_t* file) const { Mat_Close(file); }
};
struct FreeVariable {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};

Expected<TableMatrix> table_of(const matvar_t& variable, const char* name, std::size_t length) {
  const std::size_t most = std::min<std::size_t>(most_rows(length), 0x7fffffff);
  if (variable.rank != 2 || variable.dims[0] > most || variable.dims[1] > most) {
    return unexpected(invalid(name, "",
                              "must be a matrix or a vector with at most " + std::to_string(most) +
                                  " rows and columns, for the file's length"));
  }
  if (variable.isComplex != 0) return unexpected(invalid(name, "complex", "must be real"));
  TableMatrix table{static_cast<Index>(variable.dims[0]), static_cast<Index>(variable.dims[1])};
  if (table.rows == 0 || table.columns == 0) return table;
  const bool sparse = variable.class_type == MAT_C_SPARSE;
  if (variable.data_type != MAT_T_DOUBLE || variable.data == nullptr ||
      !(sparse || variable.class_type == MAT_C_DOUBLE))
    return unexpected(invalid(name, "must be of class double, full or sparse"));
  if (sparse) {
    const auto& data = *static_cast<const mat_sparse_t*>(variable.data);
    const auto* values = static_cast<const double*>(data.data);
    return table_of_columns(name, table.rows, table.columns, std::span(data.jc, data.njc),
                            std::span(data.ir, data.nir), std::vector<double>(values, values + data.ndata));
  }
  const auto* values = static_cast<const double*>(variable.data);
  const std::size_t rows = variable.dims[0], count = rows * variable.dims[1];
  if (variable.nbytes / sizeof(double) < count) return unexpected(invalid(name, "ends too soon"));
  for (std::size_t k = 0; k < count; ++k) {
    if (values[k] != 0.0)
      table.entries.add(static_cast<Index>(k % rows), static_cast<Index>(k / rows), values[k]);
  }
  return table;
}

Expected<ProblemFile> read_here(const std::string& path, const std::string& name, std::size_t length) {
  const std::unique_ptr<mat_t, CloseFile> file(Mat_Open(path.c_str(), MAT_ACC_RDONLY));
  if (file == nullptr)
    return unexpected(failure(ErrorCode::invalid_argument, "cannot be read as a MATLAB file"));
  const auto read = [&](const char* part) -> Expected<std::optional<TableMatrix>> {
    const std::unique_ptr<matvar_t, FreeVariable> variable(Mat_VarRead(file.get(), part));
    if (variable == nullptr) return std::nullopt;
    return table_of(*variable, part, length);
  };
  return assemble_lcqpow(read, name);
}

// Limits the memory to what this process has plus `bytes`.
void bound_memory(std::size_t bytes) {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlim_t limit = pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) + bytes;
  rlimit now = {};
  if (getrlimit(RLIMIT_AS, &now) == 0 && now.rlim_cur < limit) return;
  now.rlim_cur = limit;
  setrlimit(RLIMIT_AS, &now);
}

// The result is passed through a file in memory: the problem as JSON, which keeps every bit, or the parts of
// the error.
constexpr char kProblem = 'P', kError = 'E', kEnd = '\0';

std::string to_text(const Expected<ProblemFile>& file) {
  if (file) return kProblem + write_problem(*file, FileFormat::json);
  const Error& error = file.error();
  return kError + std::to_string(error.index) + kEnd + error.field + kEnd + error.value + kEnd + error.bound +
         kEnd;
}

Expected<ProblemFile> from_text(const std::string& text, const std::string& name) {
  if (text.empty())
    return unexpected(failure(ErrorCode::invalid_argument, "cannot be read as a MATLAB file"));
  if (text[0] == kProblem) return parse_problem(std::string_view(text).substr(1), FileFormat::json, name);
  std::string parts[4];
  std::size_t at = 1;
  for (std::string& part : parts) {
    const std::size_t end = std::min(text.find(kEnd, at), text.size());
    part = text.substr(at, end - at);
    at = std::min(end + 1, text.size());
  }
  return unexpected(invalid(parts[1], std::atol(parts[0].c_str()), parts[2], parts[3]));
}

bool write_all(int file, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = write(file, text.data(), text.size());
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

std::string read_all(int file) {
  std::string text(static_cast<std::size_t>(std::max<off_t>(lseek(file, 0, SEEK_END), 0)), '\0');
  std::size_t size = 0;
  while (size < text.size()) {
    const ssize_t count = pread(file, text.data() + size, text.size() - size, static_cast<off_t>(size));
    if (count <= 0) break;
    size += static_cast<std::size_t>(count);
  }
  text.resize(size);
  return text;
}

// The body of the child process that reads. It must not run any inherited code, not even destructors.
[[noreturn]] void read_in_child(int out, const std::string& path, const std::string& name,
                                std::size_t length) {
  const int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
  dup2(nothing, STDOUT_FILENO);
  dup2(nothing, STDERR_FILENO);  // HDF5 prints its errors
  const rlimit no_core = {0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  const rlim_t seconds = kSeconds + length / (1 << 20);
  const rlimit time = {seconds, seconds};
  setrlimit(RLIMIT_CPU, &time);
  bound_memory(kLibraryBytes + 3 * most_bytes(length));
  bool written = false;
  try {
    written = write_all(
        out, to_text(or_out_of_memory(
                 [&] { return read_here(path, name, length); },
                 [] { return failure(ErrorCode::invalid_argument, "is too large for its length"); })));
  } catch (...) {
  }
  _exit(written ? 0 : 1);
}

}  // namespace

bool is_mat73(std::string_view bytes) {
  constexpr std::string_view kHdf5 = "\x89HDF\r\n\x1a\n";
  return bytes.substr(0, 10) == "MATLAB 7.3" || bytes.starts_with(kHdf5) ||
         (bytes.size() > 512 && bytes.substr(512).starts_with(kHdf5));
}

Expected<ProblemFile> read_mat73(const std::string& path, const std::string& name, std::size_t length) {
  const int out = memfd_create("problem", MFD_CLOEXEC);
  const pid_t child = out < 0 ? -1 : fork();
  if (child == 0) read_in_child(out, path, name, length);
  int ending = 0;
  while (child > 0 && waitpid(child, &ending, 0) < 0 && errno == EINTR) {
  }
  const std::string text = child > 0 ? read_all(out) : "";
  if (out >= 0) close(out);
  if (child < 0)
    return unexpected(failure(ErrorCode::resource_exhausted, "needs a process to be read by: there is none"));
  if (WIFSIGNALED(ending)) {
    return unexpected(failure(
        ErrorCode::invalid_argument,
        std::string("is no sound HDF5 file: its reader ended with \"") + strsignal(WTERMSIG(ending)) + '"'));
  }
  return from_text(WEXITSTATUS(ending) == 0 ? text : "", name);
}

}  // namespace marble::formats
