// The data of the last minutes, as JSON for the page.
#pragma once

#include <string>

#include "jobs/client_use.h"
#include "jobs/server_history.h"

namespace marble::server {

/// Columns, oldest first; null where there was no result.
[[nodiscard]] std::string history_json(const std::vector<ServerHistory::Point>& points);

/// Of all clients, or of `only` this one.
[[nodiscard]] std::string clients_json(const ClientShares& shares);
[[nodiscard]] std::string clients_json(const ClientShares& shares, const std::string& only);

}  // namespace marble::server
