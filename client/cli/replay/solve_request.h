// Solves a request's message of any kind, in process or on a server.
#pragma once

#include <stop_token>
#include <vector>

#include "marble/client.h"
#include "marble/v1/service.pb.h"

namespace marble::cli {

struct Solved {
  v1::Solution solution;       ///< as a server returns it, except times and options
  std::vector<Progress> rows;  ///< one per iteration
  bool all_rows = true;        ///< none was dropped
};

/// `client` may be in process. `options` are the request's, including defaults. Errors: the client's.
[[nodiscard]] Expected<Solved> solve_request(const Client& client, const v1::SolveRequest& request,
                                             const Options& options, const std::stop_token& stop);

}  // namespace marble::cli
