// Small requests that a server takes, or nearly: what fuzz targets begin with.
#pragma once

#include <google/rpc/status.pb.h>

#include "marble/v1/service.pb.h"
#include "requests/draw.h"

namespace marble::fuzz {

/// A problem of some variables, mostly with a feasible point; matrices without rows in every form that they
/// may be written in.
[[nodiscard]] v1::Problem make_problem(Draw& draw);

/// With options, starts and derivatives.
[[nodiscard]] v1::SolveRequest make_solve(Draw& draw);
[[nodiscard]] v1::SolveRequest make_scenarios(Draw& draw);
[[nodiscard]] v1::SolveRequest make_coupled(Draw& draw);
/// One of these.
[[nodiscard]] v1::SolveRequest make_any_solve(Draw& draw);

/// Several requests, one after the other, are the `details` of one message.
using Script = google::rpc::Status;
/// Of marble.v1.SessionRequest: a set-up and updates.
[[nodiscard]] Script make_session(Draw& draw);
/// Of the requests of the service Jobs. A job_id "1" is the second job that the script has submitted.
[[nodiscard]] Script make_jobs(Draw& draw);

}  // namespace marble::fuzz
