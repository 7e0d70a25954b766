#include "marble/call_controls.h"

#include "message_text.h"

namespace marble {

const char* to_string(Priority priority) {
  return client::name_of(priority, {"by_method", "realtime", "interactive", "batch"});
}

}  // namespace marble
