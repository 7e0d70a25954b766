// Provides the options of a coupled solve through a client, and what a server adds to its solution.
#pragma once

#include <cstdint>
#include <string>

#include "marble/call_controls.h"
#include "marble/composite/coupled.h"
#include "marble/composite/segments.h"

namespace marble {

/// How servers see the sessions of a coupled solve's blocks; all fields are optional.
struct BlockSessions {
  Priority priority = Priority::interactive;  ///< of every block's solves
  std::string problem_name = {};              ///< for logs and dashboards, with the block's name after it
  std::string traceparent = {};               ///< as CallControls::traceparent, for all sessions
};

/// What a server adds to a solution; empty for blocks in sessions, and in process.
struct CoupledCall {
  std::string job_id;                 ///< as in the server's log
  double queue_s = 0.0;               ///< waiting for a worker
  double total_s = 0.0;               ///< from acceptance to the solution, on the server
  std::int64_t progress_skipped = 0;  ///< iterations that were not reported because the network was slower
  std::string traceparent = {};       ///< the server's span in the caller's trace; empty if none was sent
};

/// The solution of a coupled problem whose blocks were solved on servers. If one server solved all,
/// `coordination` has no solutions of the blocks.
struct RemoteCoupledSolution : CoupledSolution, CoupledCall {
  /// Steps of blocks that were repeated because their session or its server was lost.
  std::int32_t repeated = 0;
};

/// The solution of a problem whose segments were solved on servers.
struct RemoteSegmentsSolution : SegmentsSolution, CoupledCall {
  std::int32_t repeated = 0;  ///< as RemoteCoupledSolution::repeated, for segments
};

}  // namespace marble
