// Provides a channel with its stubs, shared by everything that uses it.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "connection/target.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "marble/call_controls.h"
#include "marble/connect_options.h"
#include "marble/error.h"
#include "marble/v1/service.grpc.pb.h"
#include "mutex.h"

namespace marble::client {

inline constexpr std::chrono::duration<double> kQuickCall{5.0};  // for calls that do not wait for a solve

class Connection {
 public:
  /// Opens a connection. Errors: a bad address, name or token, TLS files that cannot be read.
  [[nodiscard]] static Expected<std::shared_ptr<const Connection>> open(const std::string& address,
                                                                        const ConnectOptions& options);
  /// Returns one connection to each server that the address lists, which retries nothing by itself. For a
  /// single server, or a name, returns the connection itself.
  [[nodiscard]] static Expected<std::vector<std::shared_ptr<const Connection>>> each(
      const std::shared_ptr<const Connection>& all);

  /// Sets a call's metadata and its deadline.
  void prepare(grpc::ClientContext& context,
               std::optional<std::chrono::duration<double>> deadline = std::nullopt) const;
  /// The same for a call that may have its own span. Errors: the span cannot be sent.
  [[nodiscard]] Expected<void> prepare(grpc::ClientContext& context, const std::string& traceparent,
                                       std::optional<std::chrono::duration<double>> deadline) const;

  /// The same with the span and the deadline of these controls.
  [[nodiscard]] Expected<void> prepare(grpc::ClientContext& context, const CallControls& call) const {
    return prepare(context, call.traceparent, deadline_of(call.deadline));
  }

  /// Returns the call's own deadline, else the connection's.
  [[nodiscard]] std::optional<std::chrono::duration<double>> deadline_of(
      const std::optional<std::chrono::duration<double>>& call) const {
    return call ? call : options_.deadline;
  }

  [[nodiscard]] const std::string& address() const { return address_; }
  /// True if a server has ever responded over it.
  [[nodiscard]] bool reached() const { return reached_; }
  void note_reached() const { reached_ = true; }
  /// Waits before the next try after the loss of a server. Returns true as soon as a stop is requested.
  [[nodiscard]] bool pause(std::chrono::duration<double> time, const std::stop_token& stop) const;
  [[nodiscard]] v1::Solver::Stub& solver() const { return *solver_; }
  /// Returns a stub for a stream that stays open, such as a session's: on a connection with a free stream,
  /// opened if there is none. The stream must end before the returned stub does. gRPC silently holds back
  /// calls beyond a server's limit of streams per connection. Errors: as open().
  [[nodiscard]] Expected<std::shared_ptr<v1::Solver::Stub>> solver_for_stream() const
      ABSL_LOCKS_EXCLUDED(lanes_access_);
  [[nodiscard]] v1::Jobs::Stub& jobs() const { return *jobs_; }
  [[nodiscard]] v1::Server::Stub& server() const { return *server_; }
  [[nodiscard]] grpc::health::v1::Health::Stub& health() const { return *health_; }

 private:
  void add(grpc::ClientContext& context, const std::string& traceparent,
           std::optional<std::chrono::duration<double>> deadline) const;
  Connection(std::string address, Target target, const std::shared_ptr<grpc::Channel>& channel,
             const ConnectOptions& options);

  // A channel for streams that stay open.
  struct Lane {
    explicit Lane(std::unique_ptr<v1::Solver::Stub> stub) : solver(std::move(stub)) {}
    std::unique_ptr<v1::Solver::Stub> solver;
    std::atomic<int> streams = 0;
  };

  std::string address_;
  Target target_;
  std::string authorization_;  // empty without a token
  ConnectOptions options_;
  std::unique_ptr<v1::Solver::Stub> solver_;
  std::unique_ptr<v1::Jobs::Stub> jobs_;
  std::unique_ptr<v1::Server::Stub> server_;
  std::unique_ptr<grpc::health::v1::Health::Stub> health_;
  mutable std::atomic<bool> reached_ = false;
  mutable Mutex lanes_access_;
  mutable std::vector<std::shared_ptr<Lane>> lanes_
      ABSL_GUARDED_BY(lanes_access_);  // the shared channel first
};

}  // namespace marble::client
