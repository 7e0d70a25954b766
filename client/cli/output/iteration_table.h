// The iteration table, for local and remote solves alike: one row an iteration. Of a tree (option global) one
// with columns of its own, where the incumbent is better or a while has passed.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>

#include "marble/progress.h"

namespace marble::cli {

/// Whether standard error is a terminal that wants colours (NO_COLOR is not set).
[[nodiscard]] bool colours_wanted();

class IterationTable final : public ProgressSink {
 public:
  explicit IterationTable(bool colours, std::FILE* to = stderr) : colours_(colours), to_(to) {}
  /// What is solved minimizes the negative of a maximum: objectives and bounds are printed as the maximum's.
  void set_maximize(bool maximize) { sign_ = maximize ? -1.0 : 1.0; }
  void report(const Progress& progress) override;
  /// What the solve is doing, from any thread, where nothing was written for half a second: on a terminal in
  /// a line that the next row replaces, else in a line of its own every two seconds at most.
  void show(const std::string& activity);
  /// Takes that line away.
  void clear();

 private:
  void heading(const char* names);
  void tree_row(const Progress& progress);
  [[nodiscard]] double of_file(double objective) const {
    return sign_ * objective + 0.0;
  }  // no negative zero
  void erase_line();

  bool colours_;
  std::FILE* to_;
  double sign_ = 1.0;   // of objectives
  int rows_ = 0;        // since the last heading of its kind
  bool tree_ = false;   // of what kind that was
  Progress told_ = {};  // the newest row that was written
  std::mutex mutex_;
  bool open_line_ = false;  // there is one without an end
  std::string shown_;       // what was in the last such line
  std::chrono::steady_clock::time_point written_ = std::chrono::steady_clock::now();
};

/// Shows what a solve is doing in a table while it lives, wherever its rows are silent.
class ActivityDisplay {
 public:
  explicit ActivityDisplay(IterationTable& table);
  ~ActivityDisplay();
  ActivityDisplay(const ActivityDisplay&) = delete;
  ActivityDisplay& operator=(const ActivityDisplay&) = delete;

  [[nodiscard]] ActivityMonitor* monitor() { return &monitor_; }

 private:
  void run(const std::stop_token& stop);

  IterationTable& table_;
  ActivityMonitor monitor_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;  // the last member: it uses the others
};

}  // namespace marble::cli
