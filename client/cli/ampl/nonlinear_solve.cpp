#include "ampl/nonlinear_solve.h"

#include "marble/client.h"

namespace marble::cli {

Expected<nonlinear::Answer> solve_nonlinear(const formats::NlNonlinear& nl,
                                            const nonlinear::Settings& settings,
                                            const ServerArguments* server) {
  const auto solve = [&]() -> Expected<nonlinear::Answer> {
    if (server == nullptr) return nonlinear::solve(nl.problem, nonlinear::open_ticks_in_process, settings);
    const auto client = connect(*server);
    if (!client) return unexpected(client.error());
    return nonlinear::solve(nl.problem, *client, settings);
  };
  auto answer = solve();
  if (answer) return answer;
  Error error = nl.named(std::move(answer.error()));
  if (server != nullptr && error.code != ErrorCode::invalid_argument)
    error.bound += " (server " + server->server + ")";
  return unexpected(std::move(error));
}

}  // namespace marble::cli
