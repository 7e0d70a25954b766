// The work of a worker for a request of problems that shared rows couple, or of a long one in segments.
#pragma once

#include <memory>

#include "config/config.h"
#include "jobs/job.h"
#include "marble/composite/coupled.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

/// True if the request's problems are those of its blocks.
[[nodiscard]] inline bool has_blocks(const v1::SolveRequest& request) {
  return request.coupled().blocks_size() > 0;
}

/// Checks the blocks, the rows between them and that there is no other problem; returns the sizes of the
/// monolithic problem. Error fields are paths from the request's root. Errors: invalid_argument;
/// resource_exhausted (more blocks than the server allows, or rows whose dense matrices do not fit into the
/// memory of one solver).
[[nodiscard]] Expected<BlockPlace> check_blocks(const Config& config, const v1::SolveRequest& request);

/// Sets the job's work and what its solution contains besides. Checks everything in `request.coupled` that
/// check_blocks() did not; the work keeps the request, whose problem and options are valid. Errors: as
/// above.
[[nodiscard]] Expected<void> set_coupled_work(const Config& config,
                                              std::shared_ptr<const v1::SolveRequest> request,
                                              const Options& options, Job& job);

}  // namespace marble::server
