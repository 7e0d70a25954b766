// Measures the minimal cost of a response over gRPC: a server that sends the same bytes for every request.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "support/child_process.h"

namespace marble::bench {

/// Runs in a separate process, as the server that it is compared with.
class EchoServer {
 public:
  /// `answer` is the bytes of the response to Solver.Solve.
  explicit EchoServer(const std::string& answer);
  [[nodiscard]] const std::string& tcp_address() const { return addresses_.at(0); }
  [[nodiscard]] const std::string& unix_address() const { return addresses_.at(1); }

  /// The body of that process: main() calls it for "--echo-server FOLDER".
  static int serve(const std::string& folder);

 private:
  testing::TemporaryDirectory folder_;
  std::unique_ptr<testing::ChildProcess> process_;
  std::vector<std::string> addresses_;
};

}  // namespace marble::bench
