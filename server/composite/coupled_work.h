// What a worker does for a request of problems that rows tie together, or of a long one in pieces.
#pragma once

#include <memory>

#include "config/config.h"
#include "marble/composite/coupled.h"
#include "marble/v1/service.pb.h"
#include "queue/job.h"

namespace marble::server {

/// Whether the request's problems are those of its blocks.
[[nodiscard]] inline bool has_blocks(const v1::SolveRequest& request) {
  return request.coupled().blocks_size() > 0;
}

/// Checks the blocks, the rows between them and that there is no other problem; the sizes of the joint one.
/// Error fields are paths from the request's root. Errors: invalid_argument; resource_exhausted (more blocks
/// than the server allows, or rows whose dense matrices do not fit into the memory of one solver).
[[nodiscard]] Expected<BlockPlace> check_blocks(const Config& config, const v1::SolveRequest& request);

/// Sets the job's work and what its answer says besides. Everything about `request.coupled` that
/// check_blocks() did not is checked, and the work keeps the request, whose problem and options are good.
/// Errors: as above.
[[nodiscard]] Expected<void> set_coupled_work(const Config& config,
                                              std::shared_ptr<const v1::SolveRequest> request,
                                              const Options& options, Job& job);

}  // namespace marble::server
