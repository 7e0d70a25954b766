// Provides Ctrl-C as a stop token.
#pragma once

#include <stop_token>
#include <thread>

namespace marble::cli {

/// During its lifetime the first SIGINT stops the token and a second one ends the program as usual. Only one
/// may exist at a time. Has no effect if SIGINT is ignored (a background job of a script).
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }

 private:
  std::stop_source source_;
  std::thread watch_;
};

}  // namespace marble::cli
