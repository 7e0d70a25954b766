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

/// The answer of a coupled problem whose blocks were solved on servers.
struct RemoteCoupledSolution : CoupledSolution {
  /// Steps of blocks that were asked for again, since their session or its server was lost.
  std::int32_t repeated = 0;
};

/// The answer of a problem whose pieces were solved on servers.
struct RemotePiecesSolution : PiecesSolution {
  std::int32_t repeated = 0;  ///< as RemoteCoupledSolution has it, of pieces
};

}  // namespace marble
