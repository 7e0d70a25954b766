// The iteration table, for local and remote solves alike: one row an iteration.
#pragma once

#include <cstdio>

#include "marble/progress.h"

namespace marble::cli {

/// Whether standard error is a terminal that wants colours (NO_COLOR is not set).
[[nodiscard]] bool colours_wanted();

class IterationTable final : public ProgressSink {
 public:
  explicit IterationTable(bool colours, std::FILE* to = stderr) : colours_(colours), to_(to) {}
  void report(const Progress& progress) override;

 private:
  bool colours_;
  std::FILE* to_;
  int rows_ = 0;
};

}  // namespace marble::cli
