// A nonlinear .nl file's problem, solved here or on a server.
#pragma once

#include "arguments/server_arguments.h"
#include "marble/nonlinear.h"
#include "nl_functions/nl_nonlinear.h"

namespace marble::cli {

/// `server` is null, or names one: else in this process. Errors tell constraints by the file's names.
[[nodiscard]] Expected<nonlinear::Answer> solve_nonlinear(const formats::NlNonlinear& nl,
                                                          const nonlinear::Settings& settings,
                                                          const ServerArguments* server);

}  // namespace marble::cli
