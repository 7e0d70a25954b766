// What all clients of the chaos share: where the server is, whether it is being restarted, and when to rest
// or stop.
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <string>
#include <vector>

namespace marble::testing {

/// Thread-safe.
class Environment {
 public:
  Environment(std::string address, int clients) : address_(std::move(address)), clients_(clients) {}

  [[nodiscard]] const std::string& address() const { return address_; }

  /// Even while a server serves, odd from before it is asked to stop until the next one answers. A client
  /// that connected in the generation of now has no excuse for losing its server.
  [[nodiscard]] int generation() const { return generation_; }
  void next_generation();
  /// Waits until a server serves, and returns its generation.
  int wait_for_server();

  /// Between two episodes of a client: waits while all are to rest. False when it is time to stop.
  [[nodiscard]] bool go_on();
  /// Returns when every client is between two episodes, where it stays.
  void rest();
  void resume();
  void stop();
  [[nodiscard]] bool stopped() const { return stopped_; }

  /// Something that must not happen.
  void fault(const std::string& text);
  [[nodiscard]] std::vector<std::string> faults() const;

 private:
  const std::string address_;
  const int clients_;
  std::atomic<int> generation_ = 0;
  std::atomic<bool> stopped_ = false;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool resting_ = false;
  int at_rest_ = 0;
  std::vector<std::string> faults_;
};

}  // namespace marble::testing
