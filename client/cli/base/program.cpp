#include "base/program.h"

#include <poll.h>
#include <spawn.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>

namespace marble::cli {
namespace {

using Clock = std::chrono::steady_clock;

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

// Files, not pipes: a program that writes much before it reads is not blocked.
struct Streams {
  File in{std::tmpfile()}, out{std::tmpfile()}, err{std::tmpfile()};
  [[nodiscard]] bool open() const { return in && out && err; }
};

std::string content_of(std::FILE* file) {
  std::rewind(file);
  std::string content;
  char chunk[16384];
  for (std::size_t count = 0; (count = std::fread(chunk, 1, sizeof chunk, file)) > 0;)
    content.append(chunk, count);
  return content;
}

// Returns errno on failure.
int spawn(const std::vector<std::string>& words, const Streams& streams, bool own_group, pid_t& child) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fileno(streams.in.get()), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(streams.out.get()), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(streams.err.get()), STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  if (own_group) posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const int fault = posix_spawnp(&child, arguments[0], &actions, &attributes, arguments.data(), environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return fault;
}

int wait_for(pid_t child) {
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

// Returns whether it had to be killed. A stop token cannot wake this thread, so it is polled.
bool outlives(pid_t child, const ProgramLimits& limits) {
  constexpr double kLookEvery = 0.1;
  const int handle = static_cast<int>(syscall(SYS_pidfd_open, child, 0U));
  const auto begun = Clock::now();
  bool killed = false;
  for (bool ended = handle < 0; !ended && !killed;) {
    const double spent = std::chrono::duration<double>(Clock::now() - begun).count();
    const double left = limits.seconds.value_or(std::numeric_limits<double>::infinity()) - spent;
    pollfd event = {handle, POLLIN, 0};
    ended = poll(&event, 1, static_cast<int>(1e3 * std::clamp(left, 0.0, kLookEvery))) > 0;
    if (!ended && (left <= 0.0 || limits.stop.stop_requested())) {
      killed = true;
      kill(-child, SIGKILL);
    }
  }
  if (handle >= 0) close(handle);
  return killed;
}

Error internal(const std::string& program, const char* what, int fault) {
  return failure(ErrorCode::internal, program, std::string(what) + std::strerror(fault));
}

}  // namespace

Expected<ProgramEnd> run_program(const std::vector<std::string>& words, const std::string& input,
                                 const ProgramLimits& limits) {
  const Streams streams;
  if (!streams.open()) return unexpected(internal(words[0], "no temporary file: ", errno));
  std::fwrite(input.data(), 1, input.size(), streams.in.get());
  std::rewind(streams.in.get());
  const bool limited = limits.seconds.has_value() || limits.stop.stop_possible();
  pid_t child = -1;
  const int fault = spawn(words, streams, limited, child);
  if (fault == ENOENT) return unexpected(failure(ErrorCode::not_found, words[0], "is not installed"));
  if (fault != 0) return unexpected(internal(words[0], "cannot be started: ", fault));
  ProgramEnd end;
  end.killed = limited && outlives(child, limits);
  const int status = wait_for(child);
  end.well = WIFEXITED(status) && WEXITSTATUS(status) == 0;
  end.out = content_of(streams.out.get());
  end.err = content_of(streams.err.get());
  return end;
}

}  // namespace marble::cli
