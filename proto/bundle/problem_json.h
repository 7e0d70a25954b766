// A problem message as a problem file, piece by piece: write_json() of marble/json_problem.h makes it in
// memory, where it takes many times the message, and a server has others to serve.
#pragma once

#include <functional>
#include <string_view>

#include "marble/error.h"
#include "marble/v1/service.pb.h"

namespace marble {

/// Whether the request has a problem of its own: that of blocks is in `coupled`.
[[nodiscard]] bool has_problem(const v1::SolveRequest& request);

/// Reports the file piece by piece: the project's JSON, one line, every double with every bit. What is no
/// problem is written as it is, as far as indices lead. Errors: those of `report`.
[[nodiscard]] Expected<void> write_problem_json(
    const v1::SolveRequest& request, const std::function<Expected<void>(std::string_view)>& report);

}  // namespace marble
