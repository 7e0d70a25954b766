// Builds the requests of a session.
#pragma once

#include <vector>

#include "marble/session.h"
#include "marble/v1/session.pb.h"

namespace marble::client {

[[nodiscard]] Expected<v1::SessionRequest> make_setup(const ProblemView& problem, const Options& options,
                                                      const SessionOptions& session);
/// `epoch` is the epoch of the set-up.
[[nodiscard]] Expected<v1::SessionRequest> make_update(std::int64_t epoch, std::int64_t sequence,
                                                       const ProblemUpdate& update,
                                                       const UpdateControls& controls, bool first_part);

// Remembers what is needed to open a session again in its current state.
class SessionMemory {
 public:
  explicit SessionMemory(v1::SessionRequest setup) : setup_(std::move(setup)) {}
  /// Marks the session that is opened next as another one.
  void count_epoch() { setup_.mutable_setup()->set_epoch(setup_.setup().epoch() + 1); }

  /// The server applied the update: its numbers and options hold from now on.
  void take(const ProblemUpdate& update, const UpdateControls& controls);
  /// The server applied the first part of an update: the same, and the start of the second part.
  void take_first_part(const ProblemUpdate& update, const UpdateControls& controls);
  /// Stores a solution that the next solve starts from.
  void take(const std::vector<double>& z);

  /// Returns the set-up that starts where `next` would have started: at the last z, shifted, unless it is
  /// cold.
  [[nodiscard]] v1::SessionRequest setup(const UpdateControls& next) const;

 private:
  v1::SessionRequest setup_;
  std::vector<double> last_z_;
};

}  // namespace marble::client
