// The running jobs, in a file beside the store: the starts in it when a server is killed were running at
// that time. A line is a write to the system's cache, which outlives the process and waits for no disk.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "marble/error.h"
#include "mutex.h"

namespace marble::server {

/// A start of a job.
struct JobStart {
  std::string id;
  int number = 1;  ///< including earlier ones during which the server died
};

/// Thread-safe.
class RunningJobs {
 public:
  /// Opens the file, or creates it. Errors: unavailable.
  [[nodiscard]] static Expected<RunningJobs> open(const std::string& file);

  /// Returns the unfinished starts of the last server. None if the machine has restarted since: that was no
  /// job's fault.
  [[nodiscard]] std::vector<JobStart> left() const;
  /// Removes all starts. Errors: unavailable.
  [[nodiscard]] Expected<void> clear();

  /// Once this returns, a kill leaves the start in the file. Ids of more than 64 bytes, or with a space, are
  /// not the server's, and are not written.
  void began(const JobStart& start) ABSL_LOCKS_EXCLUDED(state_->mutex);
  void ended(const std::string& id) ABSL_LOCKS_EXCLUDED(state_->mutex);

 private:
  struct State {
    Mutex mutex;
    std::vector<std::string> lines ABSL_GUARDED_BY(mutex);  // ids by line; empty where none runs
  };
  RunningJobs(std::string file, Descriptor descriptor)
      : file_(std::move(file)), descriptor_(std::move(descriptor)) {}
  void write(std::size_t line, const std::string& text) const;

  std::string file_;
  Descriptor descriptor_;
  std::unique_ptr<State> state_ = std::make_unique<State>();
};

}  // namespace marble::server
