// What a session would have to be told to be set up again as it is now.
#pragma once

#include <vector>

#include "marble/session.h"
#include "marble/v1/session.pb.h"

namespace marble::client {

class SessionMemory {
 public:
  explicit SessionMemory(v1::SessionRequest setup) : setup_(std::move(setup)) {}
  /// The session that is opened next is another one.
  void count_epoch() { setup_.mutable_setup()->set_epoch(setup_.setup().epoch() + 1); }

  /// The server took the update in: its numbers and options hold from now on.
  void take(const ProblemUpdate& update, const UpdateControls& controls);
  /// The server took the first part of an update in: the same, and where the second part starts.
  void take_first_part(const ProblemUpdate& update, const UpdateControls& controls);
  /// An answer that the next solve starts from.
  void take(const std::vector<double>& z);

  /// The set-up, starting where `next` would have started: at the last z, moved on, unless it is cold.
  [[nodiscard]] v1::SessionRequest setup(const UpdateControls& next) const;

 private:
  v1::SessionRequest setup_;
  std::vector<double> last_z_;
};

}  // namespace marble::client
