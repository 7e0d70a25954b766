// Which jobs run, in a file beside the store: what a server that was killed leaves there has run when it
// ended. A line is a write to the system's cache, which outlives the process and waits for no disk.
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
  int number = 1;  ///< with those before it whose server stopped meanwhile
};

/// Thread-safe.
class RunningJobs {
 public:
  /// Opens the file, or makes it. Errors: unavailable.
  [[nodiscard]] static Expected<RunningJobs> open(const std::string& file);

  /// Starts that have not ended, as the last server left them. None if the machine has been started anew
  /// since: that was no job's fault.
  [[nodiscard]] std::vector<JobStart> left() const;
  /// No job runs. Errors: unavailable.
  [[nodiscard]] Expected<void> clear();

  /// From when this returns a kill leaves the start in the file. Ids of more than 64 bytes, or with a space,
  /// are none of ours, and are not written.
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
