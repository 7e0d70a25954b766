// Runs a real marble-server on a free loopback port, for one test.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "child_process.h"

namespace marble::testing {

class ServerProcess {
 public:
  /// Starts the server at `binary` and waits until it responds. `flags` follow --listen 127.0.0.1:0 and
  /// --http none, unless they set these themselves.
  explicit ServerProcess(const std::string& binary, const std::vector<std::string>& flags = {})
      : process_(arguments(binary, flags, directory_.file("address")), directory_.file("log")) {
    const std::string file = directory_.file("address");
    const bool ready = eventually([&] { return std::filesystem::exists(file) || !process_.running(); });
    if (!ready || !process_.running()) throw std::runtime_error("marble-server did not start: " + log());
    std::ifstream lines(file);
    for (std::string line; std::getline(lines, line);) {
      if (line.rfind("http", 0) == 0) {
        http_ = line;
      } else {
        addresses_.push_back(line);
      }
    }
  }

  [[nodiscard]] const std::string& address() const { return addresses_.at(0); }
  [[nodiscard]] const std::vector<std::string>& addresses() const { return addresses_; }
  /// The address of its HTTP port, "http://127.0.0.1:4711"; empty unless --http sets one.
  [[nodiscard]] const std::string& http() const { return http_; }
  /// Returns the log so far.
  [[nodiscard]] std::string log() const { return process_.output(); }
  /// Returns the log's lines that contain all of the texts.
  [[nodiscard]] std::vector<std::string> log_lines(const std::vector<std::string>& texts) const {
    std::vector<std::string> result;
    std::istringstream lines(log());
    for (std::string line; std::getline(lines, line);) {
      const auto holds = [&](const std::string& text) { return line.find(text) != std::string::npos; };
      if (std::all_of(texts.begin(), texts.end(), holds)) result.push_back(line);
    }
    return result;
  }

  [[nodiscard]] pid_t pid() const { return process_.pid(); }
  void terminate() { process_.send(SIGTERM); }
  void send(int signal) { process_.send(signal); }
  [[nodiscard]] bool running() { return process_.running(); }
  /// Waits for its end; returns the exit code, or minus the signal that killed it.
  int wait() { return process_.wait(); }

 private:
  static std::vector<std::string> arguments(const std::string& binary, const std::vector<std::string>& flags,
                                            const std::string& address_file) {
    std::vector<std::string> result = {binary, "--address-file", address_file};
    if (std::find(flags.begin(), flags.end(), "--listen") == flags.end()) {
      result.insert(result.end(), {"--listen", "127.0.0.1:0"});
    }
    if (std::find(flags.begin(), flags.end(), "--http") == flags.end())
      result.insert(result.end(), {"--http", "none"});
    result.insert(result.end(), flags.begin(), flags.end());
    return result;
  }

  TemporaryDirectory directory_;
  ChildProcess process_;
  std::vector<std::string> addresses_;
  std::string http_;
};

}  // namespace marble::testing
