#include "grpc_log.h"

#include <grpc/support/log.h>

#include <cstring>

#include "mutex.h"

namespace marble::server {
namespace {

// gRPC's function knows no context, and its threads may be in it while ours leaves main.
struct Target {
  Mutex mutex;
  const Log* log ABSL_GUARDED_BY(mutex) = nullptr;
};

Target& target() {
  static Target* const target = new Target;  // never destroyed
  return *target;
}

// What gRPC calls an error is most often a peer's doing: no fault of this server.
LogLevel level_of(gpr_log_severity severity) {
  switch (severity) {
    case GPR_LOG_SEVERITY_ERROR:
      return spdlog::level::warn;
    case GPR_LOG_SEVERITY_INFO:
      return spdlog::level::info;
    case GPR_LOG_SEVERITY_DEBUG:
      break;
  }
  return spdlog::level::debug;
}

void write(gpr_log_func_args* message) {
  const char* slash = std::strrchr(message->file, '/');
  const std::string file = slash == nullptr ? message->file : slash + 1;
  const MutexLock lock(target().mutex);
  const Log* log = target().log;
  if (log == nullptr) return;
  const auto line = log->line({level_of(message->severity), Component::grpc, "grpc"}, file);
  if (!line) return;
  log->write(*line, {{"message", message->message}, {"source", file + ":" + std::to_string(message->line)}});
}

void set_target(const Log* log) {
  const MutexLock lock(target().mutex);
  target().log = log;
}

}  // namespace

GrpcLog::GrpcLog(const Log& log) : log_(log) {
  set_target(&log);
  gpr_set_log_function(write);
  follow_level();
}

GrpcLog::~GrpcLog() {
  gpr_set_log_function(nullptr);
  set_target(nullptr);
}

void GrpcLog::follow_level() const {
  const bool debug = log_.enabled(spdlog::level::debug, Component::grpc);
  gpr_set_log_verbosity(debug ? GPR_LOG_SEVERITY_DEBUG : GPR_LOG_SEVERITY_ERROR);
}

}  // namespace marble::server
