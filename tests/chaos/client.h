// One kind of client: what it does in an episode, what may come of it, and what came.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <condition_variable>
#include <initializer_list>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <vector>

#include "marble/v1/service.grpc.pb.h"

namespace marble::testing {

// What all clients of the chaos share: where the server is, whether it is being restarted, and when to rest
// or stop.

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

class Client {
 public:
  using Code = grpc::StatusCode;

  Client(Environment& environment, std::string kind, std::uint64_t seed)
      : environment_(environment), kind_(std::move(kind)), random_(seed) {}
  virtual ~Client() = default;
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  /// Episode after episode until the environment stops. For one thread.
  void run();

  [[nodiscard]] const std::string& kind() const { return kind_; }
  /// What came of it all, after run().
  [[nodiscard]] const std::map<std::string, std::int64_t>& tally() const { return tally_; }

 protected:
  virtual void episode() = 0;
  /// A new connection was made.
  virtual void connected(const std::shared_ptr<grpc::Channel>& channel);

  /// A context whose deadline no call that works reaches: a call that hangs is a fault instead of a hanging
  /// test.
  [[nodiscard]] static std::unique_ptr<grpc::ClientContext> new_context();

  /// Whether the server may be gone: it is not the one this client connected to, or about to end.
  [[nodiscard]] bool disturbed() const { return environment_.generation() != generation_; }
  /// Counts how a call ended. A fault, unless it is OK, one of `allowed`, RESOURCE_EXHAUSTED with RetryInfo,
  /// or the server was restarted. True if OK.
  bool ended(const grpc::Status& status, const std::string& what, std::initializer_list<Code> allowed = {});
  /// The same for an error that came within a stream.
  bool ended(const google::rpc::Status& status, const std::string& what,
             std::initializer_list<Code> allowed = {});
  /// Counts an answer. A fault, unless it is of this problem and, if solved, independently feasible.
  void answered(const v1::Problem& problem, const v1::Solution& solution);

  void fault(const std::string& text) { environment_.fault(kind_ + ": " + text); }
  void expect(bool holds, const std::string& text) {
    if (!holds) fault(text);
  }
  void count(const std::string& what) { ++tally_[what]; }

  [[nodiscard]] int pick(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }
  [[nodiscard]] bool chance(double probability) { return std::bernoulli_distribution(probability)(random_); }
  /// Up to this many milliseconds, to be out of step with everybody else.
  void dawdle(int most_ms);

  [[nodiscard]] Environment& environment() { return environment_; }
  [[nodiscard]] std::mt19937_64& random() { return random_; }
  [[nodiscard]] v1::Solver::Stub& solver() { return *solver_; }
  [[nodiscard]] v1::Jobs::Stub& jobs() { return *jobs_; }
  [[nodiscard]] const std::shared_ptr<grpc::Channel>& channel() const { return channel_; }

 private:
  void connect_again();

  Environment& environment_;
  const std::string kind_;
  std::mt19937_64 random_;
  std::map<std::string, std::int64_t> tally_;
  int generation_ = -1;  // that the channel was made in
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::Solver::Stub> solver_;
  std::unique_ptr<v1::Jobs::Stub> jobs_;
};

// Every kind of client there is.
using MakeClient = std::unique_ptr<Client> (*)(Environment&, std::uint64_t seed);

// Unary solves.
std::unique_ptr<Client> make_solve_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_deadline_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_malformed_client(Environment& environment, std::uint64_t seed);
// Streams: read to the end, cancelled at any moment, hardly read.
std::unique_ptr<Client> make_stream_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_cancel_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_slow_reader(Environment& environment, std::uint64_t seed);
// Many problems on a stream, some of them malformed, some streams given up.
std::unique_ptr<Client> make_batch_client(Environment& environment, std::uint64_t seed);
// Sessions that are used, and sessions that are left open.
std::unique_ptr<Client> make_session_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_idle_session(Environment& environment, std::uint64_t seed);
// Submitted jobs, and those who watch them all.
std::unique_ptr<Client> make_submit_client(Environment& environment, std::uint64_t seed);
std::unique_ptr<Client> make_watch_client(Environment& environment, std::uint64_t seed);
// Asks for health and counters all the time.
std::unique_ptr<Client> make_health_client(Environment& environment, std::uint64_t seed);
// Processes that are killed with -9 in the middle of a stream, a batch or a session.
std::unique_ptr<Client> make_killed_client(Environment& environment, std::uint64_t seed);
// Frames by hand that no client library would send.
std::unique_ptr<Client> make_hostile_client(Environment& environment, std::uint64_t seed);

}  // namespace marble::testing
