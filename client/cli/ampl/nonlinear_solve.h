// Solves the problem of a nonlinear .nl file, in process or on a server.
#pragma once

#include "arguments/server_arguments.h"
#include "marble/nonlinear.h"
#include "nl/nl_nonlinear.h"

namespace marble::cli {

/// `server` is null, or names a server: null solves in this process. Errors name constraints as the file
/// does.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const formats::NlNonlinear& nl,
                                                          const nonlinear::Settings& settings,
                                                          const ServerArguments* server);

}  // namespace marble::cli
