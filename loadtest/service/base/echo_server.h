// The least that an answer over gRPC costs: a server that says the same bytes to whatever is asked.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "support/processes/child_process.h"

namespace marble::bench {

/// In a process of its own, as the server it is compared with.
class EchoServer {
 public:
  /// `answer` is the bytes of the answer to Solver.Solve.
  explicit EchoServer(const std::string& answer);
  [[nodiscard]] const std::string& tcp_address() const { return addresses_.at(0); }
  [[nodiscard]] const std::string& unix_address() const { return addresses_.at(1); }

  /// What that process does: main() calls it for "--echo-server FOLDER".
  static int serve(const std::string& folder);

 private:
  testing::TemporaryDirectory folder_;
  std::unique_ptr<testing::ChildProcess> process_;
  std::vector<std::string> addresses_;
};

}  // namespace marble::bench
