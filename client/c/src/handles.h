// Defines the handles, and how their functions report errors.
#pragma once

#include <atomic>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <shared_mutex>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "marble.h"
#include "marble/client.h"

namespace marble::c {

/// Tracks the users of a handle, many readers or one that changes it, as a lock that is only tried. Solves
/// lend a handle's arrays to the solver, so a change from within a progress function or from another thread
/// must fail. (The thread that holds a shared_mutex must not try it again.)
class Usage {
 public:
  bool try_lock_shared() {
    int readers = readers_.load();
    while (readers != kChanging) {
      if (readers_.compare_exchange_weak(readers, readers + 1)) return true;
    }
    return false;
  }
  void unlock_shared() { --readers_; }
  bool try_lock() {
    int none = 0;
    return readers_.compare_exchange_strong(none, kChanging);
  }
  void unlock() { readers_ = 0; }

 private:
  static constexpr int kChanging = -1;
  std::atomic<int> readers_ = 0;
};

}  // namespace marble::c

struct marble_problem {
  marble::OwnedProblem problem;
  mutable marble::c::Usage usage = {};
};

struct marble_options {
  marble::Options options;
};

/// Reports the rows to a C function.
class Reporter final : public marble::ProgressSink {
 public:
  Reporter(marble_progress_function function, void* user, std::stop_source stop)
      : function_(function), user_(user), stop_(std::move(stop)) {}
  void report(const marble::Progress& row) override;

 private:
  marble_progress_function function_;
  void* user_;
  std::stop_source stop_;
};

/// A stop that any thread may request, even during a reset.
class CallStop {
 public:
  [[nodiscard]] std::stop_source source() const {
    const std::scoped_lock lock(mutex_);
    return source_;
  }
  void reset() {
    const std::scoped_lock lock(mutex_);
    source_ = std::stop_source();
  }

 private:
  mutable std::mutex mutex_;
  std::stop_source source_;
};

struct marble_call {
  mutable marble::c::Usage usage = {};
  CallStop stop;
  marble_progress_function function = nullptr;
  void* user = nullptr;
  std::vector<double> initial_z;
  std::optional<marble::Solution> warm_start;
  double deadline_s = std::numeric_limits<double>::infinity();
  double reopen_s = 0.0;
  double answer_grace_s = marble::SessionOptions().answer_grace.count();
  marble::Priority priority = marble::Priority::by_method;
  std::string request_id;
  marble::OwnedSensitivityRequest derivatives;

  [[nodiscard]] std::optional<std::chrono::duration<double>> deadline() const {
    if (deadline_s == std::numeric_limits<double>::infinity()) return std::nullopt;
    return std::chrono::duration<double>(deadline_s);
  }
  [[nodiscard]] bool wants_derivatives() const {
    return derivatives.directions > 0 || derivatives.losses > 0 || derivatives.E.rows > 0;
  }
  /// Returns the controls of a solve; they borrow the call's arrays, and `wanted` is set to the requested
  /// derivatives.
  [[nodiscard]] marble::SolveControls controls(marble::ProgressSink* progress,
                                               marble::SensitivityRequest& wanted) const {
    wanted = derivatives.view();
    return {.progress = function == nullptr ? nullptr : progress,
            .stop = stop.source().get_token(),
            .initial_z = initial_z,
            .warm_start = warm_start ? &*warm_start : nullptr,
            .sensitivity = wants_derivatives() ? &wanted : nullptr};
  }
  [[nodiscard]] marble::CallControls over(const std::string& problem_name) const {
    marble::CallControls over;
    over.deadline = deadline();
    over.request_id = request_id;
    over.problem_name = problem_name;
    over.priority = priority;
    return over;
  }
};

struct marble_client {
  marble::Client client;
};

struct marble_solution {
  marble::RemoteSolution solution;
};

namespace marble::c {

/// Fills `error`, if given, and returns its code.
std::int32_t fault(const Error& reason, marble_error* error);

/// Returns MARBLE_OK with an empty field.
[[nodiscard]] inline marble_error no_fault() {
  marble_error error = {};
  error.index = -1;
  return error;
}

/// Returns the error of a parameter that is NULL.
[[nodiscard]] Error null(const char* parameter);

/// Runs `work`, an Expected<void>. Exceptions become errors too: none may pass through C.
template <class Work>
std::int32_t guarded(marble_error* error, const Work& work) {
  try {
    const Expected<void> done = work();
    if (!done) return fault(done.error(), error);
    if (error != nullptr) *error = no_fault();
    return MARBLE_OK;
  } catch (const std::bad_alloc&) {
    return fault(out_of_memory(), error);
  } catch (const std::exception& thrown) {
    return fault(failure(ErrorCode::internal, thrown.what()), error);
  }
}

/// Returns the error of a parameter that another call reads or changes.
[[nodiscard]] Error in_use(const char* parameter);

/// Runs `work`, an Expected<void>, which changes `handle`, while no other call uses it.
template <class Handle, class Work>
std::int32_t change(Handle* handle, const char* parameter, marble_error* error, const Work& work) {
  return guarded(error, [&]() -> Expected<void> {
    if (handle == nullptr) return unexpected(null(parameter));
    const std::unique_lock changing(handle->usage, std::try_to_lock);
    if (!changing) return unexpected(in_use(parameter));
    return work();
  });
}

/// Errors: invalid_argument if a count is negative or larger than an index can be.
[[nodiscard]] Expected<void> check_count(std::string field, std::int64_t count);

/// Returns the caller's numbers as a span; an error if they are missing.
[[nodiscard]] Expected<std::span<const double>> numbers(const double* values, std::int64_t count);

/// Clears borrowed numbers: the state before they are found, and on failure.
template <class Number>
void none_lent(const Number** values, std::int64_t* count) {
  if (values != nullptr) *values = nullptr;
  if (count != nullptr) *count = 0;
}

/// Copies a caller's matrix. Errors: invalid_argument of fields such as "Q.rows".
[[nodiscard]] Expected<void> set_matrix(SparseMatrix& matrix, const std::string& part, std::int32_t rows,
                                        std::int32_t columns, const std::int32_t* column_pointers,
                                        std::int64_t entries, const std::int32_t* row_indices,
                                        const double* values);

/// Connects to `address`, by default to the server of MARBLE_SERVER, or to this process if it is unset.
[[nodiscard]] Expected<Client> connect(const char* address, const Keepalive& keepalive = {});

/// Passes the client to `work`, which returns an Expected<void>; without a client, that of MARBLE_SERVER.
template <class Work>
Expected<void> with_client(const marble_client* client, const Work& work) {
  if (client != nullptr) return work(client->client);
  MARBLE_ASSIGN_OR_RETURN(const auto connected, connect(nullptr));
  return work(connected);
}

}  // namespace marble::c
