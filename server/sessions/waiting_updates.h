// Updates of one session that are not solved yet, in their order, and what those leave behind that never are.
#pragma once

#include <deque>
#include <memory>
#include <optional>

#include "queue/scheduler.h"
#include "sessions/session_update.h"

namespace marble::server {

/// One thread at a time.
class WaitingUpdates {
 public:
  /// With `latest_only` at most one waits.
  explicit WaitingUpdates(bool latest_only) : latest_only_(latest_only) {}

  [[nodiscard]] bool empty() const { return updates_.empty(); }
  [[nodiscard]] std::size_t size() const { return updates_.size(); }
  /// Whether one more takes no room but the session's own, which has some for one that waits.
  [[nodiscard]] bool has_room() const { return latest_only_ || updates_.empty(); }

  /// The last in line, with the room it was given elsewhere, if any. A first part that still waits becomes
  /// one with it. The number of the one that it supersedes.
  [[nodiscard]] std::optional<std::int64_t> push(std::shared_ptr<Update> update,
                                                 std::unique_ptr<Scheduler::Held> room);
  /// The first in line, whose room is given back. There must be one.
  [[nodiscard]] std::shared_ptr<Update> pop();
  /// The next one takes along what this one, which never ran, would have changed.
  void leave_behind(Update update);
  void clear();

 private:
  struct Waiting {
    std::shared_ptr<Update> update;
    std::unique_ptr<Scheduler::Held> room;
  };
  const bool latest_only_;
  std::deque<Waiting> updates_;
  std::optional<Update> left_behind_;  // while none waits
};

}  // namespace marble::server
