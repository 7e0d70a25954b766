// A remote solve that goes on while the caller does something else.
#pragma once

#include <chrono>
#include <memory>

#include "marble/call_controls.h"
#include "marble/error.h"

namespace marble {

/// What Client::solve_async gives back. One thread at a time, but for cancel().
class PendingSolution {
 public:
  PendingSolution(PendingSolution&&) noexcept;
  PendingSolution& operator=(PendingSolution&&) noexcept;
  /// Gives the solve up, if nobody has taken its answer, and waits until nothing calls back any more.
  ~PendingSolution();

  /// Waits for the answer and gives it away; error failed_precondition the second time.
  [[nodiscard]] Expected<RemoteSolution> get();
  /// True once get() does not wait.
  [[nodiscard]] bool wait_for(std::chrono::duration<double> duration) const;
  [[nodiscard]] bool is_ready() const { return wait_for(std::chrono::duration<double>::zero()); }
  /// Asks for the end: get() gives the error cancelled, unless the answer was on its way. Thread-safe.
  void cancel();

  /// Made by the client.
  struct State;
  explicit PendingSolution(std::shared_ptr<State> state);

 private:
  std::shared_ptr<State> state_;
};

}  // namespace marble
