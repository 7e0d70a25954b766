// What stands behind the handles, and how their functions fail.
#pragma once

#include <exception>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "marble.h"
#include "marble/client.h"

struct marble_problem {
  marble::OwnedProblem problem;
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

struct marble_call {
  std::stop_source stop;
  marble_progress_function function = nullptr;
  void* user = nullptr;
  std::vector<double> initial_z;
  std::optional<marble::Solution> warm_start;
  double deadline_s = std::numeric_limits<double>::infinity();
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
            .stop = stop.get_token(),
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

/// The numbers a caller lends; an error where they are not there.
[[nodiscard]] Expected<std::span<const double>> numbers(const double* values, std::int64_t count);

/// Takes a matrix that a caller lends. Errors: invalid_argument of fields like "Q.rows".
[[nodiscard]] Expected<void> set_matrix(SparseMatrix& matrix, const std::string& part, std::int32_t rows,
                                        std::int32_t columns, const std::int32_t* column_pointers,
                                        std::int64_t entries, const std::int32_t* row_indices,
                                        const double* values);

/// Where an environment's MARBLE_SERVER says, and this process where it says nothing.
[[nodiscard]] Expected<Client> connect(const char* address);

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
