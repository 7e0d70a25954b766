// Stores a trace in a file: written during a solve, read for plots.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "base/atomic_file.h"
#include "marble/progress.h"

namespace marble::cli {

/// Writes every reported row, with every bit. The columns are progress_columns().
class TraceWriter final : public ProgressSink {
 public:
  /// Fails before anything is solved if the file cannot be written.
  [[nodiscard]] static Expected<TraceWriter> open(const std::string& path);
  void report(const Progress& row) override;
  [[nodiscard]] std::size_t rows() const { return rows_; }
  [[nodiscard]] Expected<void> commit() { return file_.commit(); }

 private:
  explicit TraceWriter(AtomicFile file);
  AtomicFile file_;
  std::string line_;
  std::size_t rows_ = 0;
};

/// Parses the text of such a file. Errors name line and column: field "line 3, column kappa".
[[nodiscard]] Expected<std::vector<Progress>> parse_trace(std::string_view text);

/// Reads a file; - is standard input. Error not_found: it cannot be read.
[[nodiscard]] Expected<std::vector<Progress>> read_trace(const std::string& path);

}  // namespace marble::cli
