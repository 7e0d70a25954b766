#include "log/library_log.h"

#include <google/protobuf/stubs/logging.h>
#include <grpc/support/log.h>

#include <cstring>

#include "mutex.h"

namespace marble::server {
namespace {

// The libraries' functions have no context parameter, and gRPC's threads may be in one while main returns.
struct Target {
  Mutex mutex;
  const Log* log ABSL_GUARDED_BY(mutex) = nullptr;
};

Target& target() {
  static Target* const target = new Target;  // never destroyed
  return *target;
}

void set_target(const Log* log) {
  const MutexLock lock(target().mutex);
  target().log = log;
}

void write(const LogEvent& event, const char* path, int number, const std::string& message) {
  const char* slash = std::strrchr(path, '/');
  const std::string file = slash == nullptr ? path : slash + 1;
  const MutexLock lock(target().mutex);
  const Log* log = target().log;
  if (log == nullptr) return;
  const auto line = log->line(event, file);
  if (line) log->write(*line, {{"message", message}, {"source", file + ":" + std::to_string(number)}});
}

// What the libraries call an error is mostly caused by a peer: no error of this server.
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

LogLevel level_of(google::protobuf::LogLevel level) {
  switch (level) {
    case google::protobuf::LOGLEVEL_FATAL:
      return spdlog::level::err;
    case google::protobuf::LOGLEVEL_ERROR:
    case google::protobuf::LOGLEVEL_WARNING:
      return spdlog::level::warn;
    case google::protobuf::LOGLEVEL_INFO:
      break;
  }
  return spdlog::level::info;
}

void write_grpc(gpr_log_func_args* message) {
  write({level_of(message->severity), Component::grpc, "grpc"}, message->file, message->line,
        message->message);
}

void write_protobuf(google::protobuf::LogLevel level, const char* file, int line,
                    const std::string& message) {
  write({level_of(level), Component::grpc, "protobuf"}, file, line, message);
}

}  // namespace

LibraryLog::LibraryLog(const Log& log) : log_(log) {
  set_target(&log);
  gpr_set_log_function(write_grpc);
  google::protobuf::SetLogHandler(write_protobuf);
  follow_level();
}

LibraryLog::~LibraryLog() { set_target(nullptr); }

void LibraryLog::follow_level() const {
  const bool debug = log_.enabled(spdlog::level::debug, Component::grpc);
  gpr_set_log_verbosity(debug ? GPR_LOG_SEVERITY_DEBUG : GPR_LOG_SEVERITY_ERROR);
}

}  // namespace marble::server
