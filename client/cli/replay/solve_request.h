// A request's message, solved: whatever it asks for, here or by a server.
#pragma once

#include <stop_token>
#include <vector>

#include "marble/client.h"
#include "marble/v1/service.pb.h"

namespace marble::cli {

struct Solved {
  v1::Solution solution;       ///< as a server would answer, but for times and options
  std::vector<Progress> rows;  ///< of every iteration
  bool all_rows = true;        ///< none was dropped on the way
};

/// `client` may be in process. `options` are the request's, defaults included. Errors: the client's.
[[nodiscard]] Expected<Solved> solve_request(const Client& client, const v1::SolveRequest& request,
                                             const Options& options, const std::stop_token& stop);

}  // namespace marble::cli
