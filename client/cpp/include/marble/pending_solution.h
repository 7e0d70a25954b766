// A solve that goes on while the caller does something else.
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

/// What Client::solve_async gives back. One thread at a time may use it, but for cancel(). No call throws.
class PendingSolution {
 public:
  /// What was moved from may only be assigned to or destroyed.
  PendingSolution(PendingSolution&&) noexcept;
  /// As the constructor; what was there is given up, as the destructor does.
  PendingSolution& operator=(PendingSolution&&) noexcept;
  /// Gives the solve up if it still goes on, and waits until nothing calls back any more: not to be destroyed
  /// within a callback of its own.
  ~PendingSolution();

  /// Waits for the answer and gives it away. Errors: those of Client::solve; failed_precondition the second
  /// time.
  [[nodiscard]] Expected<RemoteSolution> get();

  /// Waits, but no longer than this (seconds; negative is 0). True once get() does not wait any more.
  [[nodiscard]] bool wait_for(std::chrono::duration<double> longest) const;
  /// Whether get() would not wait.
  [[nodiscard]] bool is_ready() const { return wait_for(std::chrono::duration<double>::zero()); }

  /// Asks for the end: get() gives the error cancelled, unless the answer was on its way. Thread-safe, in
  /// callbacks too.
  void cancel();

  struct State;  ///< the client's own
  /// Made by Client::solve_async.
  explicit PendingSolution(std::unique_ptr<State> state);

 private:
  std::unique_ptr<State> state_;
};

}  // namespace marble
