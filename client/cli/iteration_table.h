// The iteration table, for local and remote solves alike: one row an iteration on standard error.
#pragma once

#include <string>

#include "marble/progress.h"

namespace marble::cli {

/// Whether standard error is a terminal that wants colours (NO_COLOR is not set).
[[nodiscard]] bool colours_wanted();

class IterationTable final : public ProgressSink {
 public:
  explicit IterationTable(bool colours) : colours_(colours) {}
  void report(const Progress& progress) override;

 private:
  bool colours_;
  int rows_ = 0;
};

}  // namespace marble::cli
