// The iteration table, for local and remote solves alike: one row an iteration. Of a tree (option global) one
// with columns of its own, where the incumbent is better or a while has passed.
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
  void heading(const char* names);
  void tree_row(const Progress& progress);

  bool colours_;
  std::FILE* to_;
  int rows_ = 0;        // since the last heading of its kind
  bool tree_ = false;   // of what kind that was
  Progress told_ = {};  // the newest row that was written
};

}  // namespace marble::cli
