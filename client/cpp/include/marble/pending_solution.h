// Provides the handle of a solve that runs while the caller does something else.
//
//   auto pending = client->solve_async(problem, options, {.progress = &plot});
//   while (!pending->wait_for(20ms)) steer();
//   auto answer = pending->get();
#pragma once

#include <chrono>
#include <memory>

#include "marble/call_controls.h"
#include "marble/error.h"

namespace marble {

/// The handle that Client::solve_async returns. Only cancel() is thread-safe. No call throws.
class PendingSolution {
 public:
  /// A moved-from object may only be assigned to or destroyed.
  PendingSolution(PendingSolution&&) noexcept;
  /// As the constructor; cancels the solve of the overwritten handle, as the destructor does.
  PendingSolution& operator=(PendingSolution&&) noexcept;
  /// Cancels the solve if it still runs, and waits until no callback runs any more. It must not be destroyed
  /// within one of its own callbacks.
  ~PendingSolution();

  /// Waits for the solution and moves it out. Errors: those of Client::solve; failed_precondition the second
  /// time.
  [[nodiscard]] Expected<RemoteSolution> get();

  /// Waits for at most `longest` (seconds; negative is 0). Returns true once get() does not wait any more.
  [[nodiscard]] bool wait_for(std::chrono::duration<double> longest) const;
  /// True if get() would not wait.
  [[nodiscard]] bool is_ready() const { return wait_for(std::chrono::duration<double>::zero()); }

  /// Requests cancellation: get() returns the error cancelled, unless the solution was already on its way.
  /// Thread-safe, also in callbacks.
  void cancel();

  struct State;  ///< internal to the client
  /// Called by Client::solve_async.
  explicit PendingSolution(std::unique_ptr<State> state);

 private:
  std::unique_ptr<State> state_;
};

}  // namespace marble
