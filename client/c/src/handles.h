// What stands behind the handles, and how their functions fail.
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

/// Who uses a handle: many readers or one that changes it; a lock that is only tried. Solves lend a handle's
/// arrays to the solver, so a change from within a progress function or from another thread must fail. (A
/// shared_mutex must not be tried again by the thread that holds it.)
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

/// Tells a C function of the rows.
class Teller final : public marble::ProgressSink {
 public:
  Teller(marble_progress_function function, void* user, std::stop_source stop)
      : function_(function), user_(user), stop_(std::move(stop)) {}
  void report(const marble::Progress& row) override;

 private:
  marble_progress_function function_;
  void* user_;
  std::stop_source stop_;
};

/// A stop that any thread may request, a reset under way or not.
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
  /// What it says of a solve; it lends its arrays, and `wanted` becomes what it asks of derivatives.
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

/// Fills `error`, where there is one, and returns its code.
std::int32_t fault(const Error& reason, marble_error* error);

/// MARBLE_OK, of no field.
[[nodiscard]] inline marble_error no_fault() {
  marble_error error = {};
  error.index = -1;
  return error;
}

/// An error that says that a parameter is NULL.
[[nodiscard]] Error null(const char* parameter);

/// Runs `work`, an Expected<void>. What it throws is a fault too: no exception goes through C.
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

/// An error that says that another call reads or changes a parameter.
[[nodiscard]] Error in_use(const char* parameter);

/// Runs `work`, an Expected<void>, while no other call uses `handle`, which it changes.
template <class Handle, class Work>
std::int32_t change(Handle* handle, const char* parameter, marble_error* error, const Work& work) {
  return guarded(error, [&]() -> Expected<void> {
    if (handle == nullptr) return unexpected(null(parameter));
    const std::unique_lock changing(handle->usage, std::try_to_lock);
    if (!changing) return unexpected(in_use(parameter));
    return work();
  });
}

/// Errors: invalid_argument where a count is negative or larger than an index can be.
[[nodiscard]] Expected<void> check_count(std::string field, std::int64_t count);

/// The numbers a caller lends; an error where they are not there.
[[nodiscard]] Expected<std::span<const double>> numbers(const double* values, std::int64_t count);

/// What a caller has of numbers that are lent until they are found, and of those that never are.
template <class Number>
void none_lent(const Number** values, std::int64_t* count) {
  if (values != nullptr) *values = nullptr;
  if (count != nullptr) *count = 0;
}

/// Takes a matrix that a caller lends. Errors: invalid_argument of fields like "Q.rows".
[[nodiscard]] Expected<void> set_matrix(SparseMatrix& matrix, const std::string& part, std::int32_t rows,
                                        std::int32_t columns, const std::int32_t* column_pointers,
                                        std::int64_t entries, const std::int32_t* row_indices,
                                        const double* values);

/// Where an environment's MARBLE_SERVER says, and this process where it says nothing.
[[nodiscard]] Expected<Client> connect(const char* address, const Keepalive& keepalive = {});

/// Gives `work`, which returns an Expected<void>, the client, or without one that of where MARBLE_SERVER
/// says.
template <class Work>
Expected<void> with_client(const marble_client* client, const Work& work) {
  if (client != nullptr) return work(client->client);
  const auto connected = connect(nullptr);
  if (!connected) return unexpected(connected.error());
  return work(*connected);
}

}  // namespace marble::c
