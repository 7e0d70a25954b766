// What may accompany a coupled solve over a client, and what comes back.
#pragma once

#include <cstdint>
#include <string>

#include "marble/call_controls.h"
#include "marble/composite/coupled.h"
#include "marble/composite/pieces.h"

namespace marble {

/// How the sessions of a coupled solve's blocks are seen by their servers; all of it optional.
struct BlockSessions {
  Priority priority = Priority::interactive;  ///< of every block's solves
  std::string problem_name = {};              ///< for logs and dashboards, with the block's name after it
  std::string traceparent = {};               ///< as CallControls has it, of all sessions
};

/// What a server adds to an answer; empty of blocks in sessions, and in process.
struct CoupledCall {
  std::string job_id;                 ///< as in the server's log
  double queue_s = 0.0;               ///< waiting for a worker
  double total_s = 0.0;               ///< from acceptance to the answer, on the server
  std::int64_t progress_skipped = 0;  ///< iterations that were not told, because the network was slower
  std::string traceparent = {};       ///< the server's span in the caller's trace; empty if none was sent
};

/// The answer of a coupled problem whose blocks were solved on servers. Where one server did it all,
/// `coordination` has no answers of the blocks.
struct RemoteCoupledSolution : CoupledSolution, CoupledCall {
  /// Steps of blocks that were asked for again, since their session or its server was lost.
  std::int32_t repeated = 0;
};

/// The answer of a problem whose pieces were solved on servers.
struct RemotePiecesSolution : PiecesSolution, CoupledCall {
  std::int32_t repeated = 0;  ///< as RemoteCoupledSolution has it, of pieces
};

}  // namespace marble
