// Runs a child process with its output in a file: starts it, signals it, waits for it. It is killed with its
// owner.
#pragma once

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace marble::testing {

/// Polls until `condition` holds. Returns false only if it never did: the limit guards against hanging and is
/// far beyond any expected time.
template <class Condition>
[[nodiscard]] bool eventually(Condition&& condition, std::chrono::seconds limit = std::chrono::seconds(120)) {
  const auto end = std::chrono::steady_clock::now() + limit;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

/// A new directory, removed with its contents.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string pattern = (std::filesystem::temp_directory_path() / "marble test XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("cannot make a temporary directory");
    path_ = pattern;
  }
  ~TemporaryDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

[[nodiscard]] inline std::string read_file(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

class ChildProcess {
 public:
  /// Starts `arguments[0]` with standard output and error appended to `output_file`. `environment` holds
  /// "NAME=value" in addition to this process's own. Call it on the main thread: the child is killed when the
  /// calling thread ends.
  ChildProcess(std::vector<std::string> arguments, std::string output_file,
               std::vector<std::string> environment = {})
      : output_file_(std::move(output_file)) {
    for (char** own = environ; *own != nullptr; ++own)
      environment.emplace_back(*own);  // the first entry of a name is used
    const std::vector<char*> argv = pointers(arguments);
    const std::vector<char*> envp = pointers(environment);
    const int output = open(output_file_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    if (output < 0) throw std::runtime_error("cannot write " + output_file_);
    pid_ = fork();
    if (pid_ == 0) {  // only async-signal-safe calls until exec
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      dup2(output, STDOUT_FILENO);
      dup2(output, STDERR_FILENO);
      execve(argv[0], argv.data(), envp.data());
      _exit(127);
    }
    close(output);
    if (pid_ < 0) throw std::runtime_error("cannot fork");
  }
  ~ChildProcess() {
    if (running()) {
      send(SIGKILL);
      wait();
    }
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// Returns whether it runs `program`, if it was started by a shell, and handles `signal` (proc(5), SigCgt).
  [[nodiscard]] bool catches(int signal, const std::string& program) const {
    const std::string process = "/proc/" + std::to_string(pid_);
    std::error_code ignored;
    if (!std::filesystem::equivalent(process + "/exe", program, ignored)) return false;
    std::ifstream lines(process + "/status");
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("SigCgt:", 0) == 0)
        return (std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1U) != 0;
    }
    return false;
  }
  [[nodiscard]] pid_t pid() const { return pid_; }
  void send(int signal) const {
    if (!ended_) ::kill(pid_, signal);
  }
  [[nodiscard]] bool running() {
    if (!ended_ && waitpid(pid_, &status_, WNOHANG) == pid_) ended_ = true;
    return !ended_;
  }
  /// Waits for the end; returns the exit code, or minus the signal that killed it.
  int wait() {
    if (!ended_ && waitpid(pid_, &status_, 0) == pid_) ended_ = true;
    return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
  }
  /// Returns its output so far.
  [[nodiscard]] std::string output() const { return read_file(output_file_); }

 private:
  static std::vector<char*> pointers(std::vector<std::string>& strings) {
    std::vector<char*> result;
    for (std::string& text : strings) result.push_back(text.data());
    result.push_back(nullptr);
    return result;
  }

  std::string output_file_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

}  // namespace marble::testing
