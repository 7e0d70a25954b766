// One kind of client: what it does in an episode, what may come of it, and what came.
#pragma once

#include <grpcpp/grpcpp.h>

#include <initializer_list>
#include <map>
#include <memory>
#include <random>
#include <string>

#include "environment.h"
#include "marble/v1/service.grpc.pb.h"

namespace marble::testing {

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

}  // namespace marble::testing
