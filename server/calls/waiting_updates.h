// Updates of a session that are not solved yet, in order, and the changes of those that never will be.
#pragma once

#include <deque>
#include <memory>
#include <optional>

#include "calls/session_update.h"
#include "jobs/scheduler.h"

namespace marble::server {

/// Used by one thread at a time.
class WaitingUpdates {
 public:
  /// With `latest_only`, at most one waits.
  explicit WaitingUpdates(bool latest_only) : latest_only_(latest_only) {}

  [[nodiscard]] bool empty() const { return updates_.empty(); }
  [[nodiscard]] std::size_t size() const { return updates_.size(); }
  /// True if one more needs only the session's own memory, which suffices for one waiting update.
  [[nodiscard]] bool has_room() const { return latest_only_ || updates_.empty(); }

  /// Appends an update, with the memory reserved for it elsewhere, if any. A waiting preparation is merged
  /// into it. Returns the number of the update that it supersedes.
  [[nodiscard]] std::optional<std::int64_t> push(std::shared_ptr<Update> update,
                                                 std::unique_ptr<Scheduler::Held> room);
  /// Removes the first update and releases its memory. There must be one.
  [[nodiscard]] std::shared_ptr<Update> pop();
  /// Merges the changes of this update, which never ran, into the next one.
  void leave_behind(Update update);
  void clear();

 private:
  struct Waiting {
    std::shared_ptr<Update> update;
    std::unique_ptr<Scheduler::Held> room;
  };
  const bool latest_only_;
  std::deque<Waiting> updates_;
  std::optional<Update> left_behind_;  // set while no update waits
};

}  // namespace marble::server
