// Prints the iteration table of local and remote solves: one row per iteration. For a tree (global search)
// the columns differ, and a row is printed when the incumbent improves or some time has passed.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <mutex>
#include <string>
#include <thread>

#include "marble/progress.h"

namespace marble::cli {

/// True if standard error is a terminal and colours are allowed (NO_COLOR is not set).
[[nodiscard]] bool colours_wanted();

class IterationTable final : public ProgressSink {
 public:
  explicit IterationTable(bool colours, std::FILE* to = stderr) : colours_(colours), to_(to) {}
  /// The solver minimizes the negative of a maximum: objectives and bounds are printed as the maximum's.
  void set_maximize(bool maximize) { sign_ = maximize ? -1.0 : 1.0; }
  void report(const Progress& progress) override;
  /// Shows the solve's current activity, from any thread, if nothing was written for half a second: on a
  /// terminal in a line that the next row replaces, else in a separate line every two seconds at most.
  void show(const std::string& activity);
  /// Removes that line.
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
  double sign_ = 1.0;       // of objectives
  int rows_ = 0;            // since the last heading of its kind
  bool tree_ = false;       // the kind of that heading
  Progress reported_ = {};  // the last row that was written
  std::mutex mutex_;
  bool open_line_ = false;  // the current line has no end yet
  std::string shown_;       // the content of the last such line
  std::chrono::steady_clock::time_point written_ = std::chrono::steady_clock::now();
};

/// Shows a solve's activity in a table during its lifetime, whenever its rows are silent.
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
