// The tables of a store that several servers share.
#pragma once

#include <string>

#include "base/postgres.h"

namespace marble::server {

/// States of a job in the tables; `draft`: an array that is being received, which no one sees.
enum class FleetState { waiting = 0, running = 1, answered = 2, gone = 3, draft = 4 };

/// Listens for the notifications of changes between servers.
constexpr const char* kFleetListen = "LISTEN marble_jobs";
constexpr const char* kFleetNotify = "NOTIFY marble_jobs";

/// Creates the tables if there are none. Errors: failed_precondition (they are of another version);
/// unavailable.
[[nodiscard]] Expected<void> prepare_fleet(Postgres& database);

/// Returns the line of --check-state.
[[nodiscard]] Expected<std::string> check_fleet(const std::string& uri);

}  // namespace marble::server
