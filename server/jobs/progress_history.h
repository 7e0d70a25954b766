// The progress of a job's solve so far: a bounded trace of the whole, thinned evenly, and its newest rows
// for watchers. The worker adds rows and never waits; readers continue with a cursor.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "marble/progress.h"

namespace marble::server {

class ProgressHistory {
 public:
  static constexpr std::size_t kRecent = 128;

  /// `trace_rows` may be 0: then there is no trace.
  explicit ProgressHistory(int trace_rows) : most_rows_(static_cast<std::size_t>(trace_rows)) {}

  struct Rows {
    std::vector<Progress> rows;  ///< oldest first, without vectors
    std::int64_t skipped = 0;    ///< number of dropped rows after the cursor
  };

  void put(const Progress& progress) {
    newest_ = without_vectors(progress);
    if (recent_.size() < kRecent) {
      recent_.push_back(newest_);
    } else {
      recent_[static_cast<std::size_t>(count_) % kRecent] = newest_;
    }
    if (most_rows_ > 0 && (count_ - first_) % stride_ == 0) {
      trace_.push_back(newest_);
      if (trace_.size() > most_rows_) thin();
    }
    ++count_;
  }

  /// Counts rows that were added but cannot be reported any more.
  void skip(std::int64_t rows) {
    count_ += rows;
    recent_.assign(kRecent, newest_);
    known_from_ = count_;
  }

  /// Returns the rows since the cursor, which advances to the newest.
  [[nodiscard]] Rows read(std::int64_t& cursor) const {
    Rows result;
    const std::int64_t oldest = std::max(known_from_, count_ - static_cast<std::int64_t>(recent_.size()));
    result.skipped = std::max<std::int64_t>(0, oldest - cursor);
    for (std::int64_t at = std::max(cursor, oldest); at < count_; ++at)
      result.rows.push_back(recent_[static_cast<std::size_t>(at) % kRecent]);
    cursor = count_;
    return result;
  }

  /// Returns every stride-th row of all, oldest first, and the newest.
  [[nodiscard]] std::vector<Progress> trace() const {
    std::vector<Progress> rows = trace_;
    if (most_rows_ > 0 && count_ > first_ && (count_ - 1 - first_) % stride_ != 0) rows.push_back(newest_);
    return rows;
  }
  [[nodiscard]] int stride() const { return stride_; }
  /// Number of rows added so far; equals the cursor of a reader who has read them all.
  [[nodiscard]] std::int64_t count() const { return count_; }
  [[nodiscard]] const Progress& newest() const { return newest_; }

  /// Restores the trace of a solve that has ended.
  void restore(std::vector<Progress> trace, int stride) {
    if (most_rows_ == 0 || trace.empty()) return;
    trace_ = std::move(trace);
    newest_ = trace_.back();
    stride_ = stride;
    while (trace_.size() > most_rows_) thin();
    count_ = first_ = known_from_ = 0;  // no reader continues: only the trace is reported
  }

  /// Starts another solve with a trace of its own. Cursors stay valid.
  void begin() {
    trace_.clear();
    stride_ = 1;
    first_ = count_;
  }
  /// No row will be added or read any more: keeps only the trace.
  void end() {
    recent_ = {};
    trace_.shrink_to_fit();
  }

 private:
  // Keeps every other row.
  void thin() {
    std::size_t kept = 0;
    for (std::size_t at = 0; at < trace_.size(); at += 2) trace_[kept++] = trace_[at];
    trace_.resize(kept);
    stride_ = std::min(stride_, std::numeric_limits<int>::max() / 2) * 2;
  }

  std::size_t most_rows_;
  std::vector<Progress> trace_, recent_;
  Progress newest_;
  int stride_ = 1;
  std::int64_t count_ = 0, first_ = 0;  // rows of all solves; rows before this solve
  std::int64_t known_from_ = 0;         // earlier rows were skipped
};

}  // namespace marble::server
