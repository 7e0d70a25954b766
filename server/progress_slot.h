// The newest progress of one solve: the worker overwrites, the stream takes when it can. Nobody waits for a
// reader.
#pragma once

#include <absl/base/thread_annotations.h>
#include <absl/synchronization/mutex.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "marble/progress.h"

namespace marble::server {

class ProgressSlot {
 public:
  struct Entry {
    Progress progress;         ///< its z is empty; see below
    std::vector<double> z;     ///< the iterate, if it was asked for
    std::int64_t skipped = 0;  ///< entries that were overwritten before anyone took them
  };

  void put(const Progress& progress, bool with_iterate) {
    absl::MutexLock lock(&mutex_);
    if (full_) ++entry_.skipped;
    entry_.progress = progress;
    entry_.progress.z = {};
    if (with_iterate) {
      entry_.z.assign(progress.z.begin(), progress.z.end());
    } else {
      entry_.z.clear();
    }
    full_ = true;
  }

  /// The newest entry since the last take, or nothing. `skipped` counts from the start of the solve.
  [[nodiscard]] std::optional<Entry> take() {
    absl::MutexLock lock(&mutex_);
    if (!full_) return std::nullopt;
    full_ = false;
    return entry_;
  }

 private:
  absl::Mutex mutex_;
  bool full_ ABSL_GUARDED_BY(mutex_) = false;
  Entry entry_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
