// A server of the simulation: the parts that marble-server wires (server/main.cpp), without gRPC and HTTP, in
// a group of threads of its own; it is started, stopped and killed, and keeps its jobs in a directory.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "service/service_parts.h"
#include "threads.h"

namespace marble::simulation {

/// What comes back to a client: once, or never, if the server is killed first.
template <class Value>
class Reply {
 public:
  void send(Value value) {
    const std::lock_guard lock(mutex_);
    ++times_;
    if (!value_) value_ = std::move(value);
    changed_.notify_all();
  }
  void lose() {
    const std::lock_guard lock(mutex_);
    lost_ = true;
    changed_.notify_all();
  }
  /// Null: the server was killed, or the time is over.
  std::optional<Value> wait(Duration most) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, most, [&] { return value_.has_value() || lost_; });
    return value_;
  }
  [[nodiscard]] bool is_lost() {
    const std::lock_guard lock(mutex_);
    return lost_;
  }
  [[nodiscard]] int times() {
    const std::lock_guard lock(mutex_);
    return times_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Value> value_;
  bool lost_ = false;
  int times_ = 0;
};

class Server {
 public:
  /// Keeps its jobs in folders below `folder`: a new copy after each crash, as a dead server's locks stay.
  Server(server::Config config, std::filesystem::path folder);
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  /// Returns once it takes calls. The error is that of a server which does not start.
  [[nodiscard]] Expected<void> start();
  /// As by SIGTERM: returns when it has ended. Calls until then are answered.
  void stop();
  /// As by SIGKILL; with `power_failure`, the machine fails, and writes that were not synced may be lost. May
  /// be called on one of its own threads, and does not return then.
  void kill(bool power_failure = false);
  [[nodiscard]] bool is_up();

  /// Runs `handle` on a thread of the server, as a call; its reply is lost if the server is killed. False if
  /// the server is down.
  template <class Value>
  bool call(const std::shared_ptr<Reply<Value>>& reply,
            std::function<void(const server::ServiceParts&, const std::shared_ptr<Reply<Value>>&)> handle) {
    const std::lock_guard lock(mutex_);
    if (parts_ == nullptr) return false;
    const server::ServiceParts& parts = *parts_;
    lose_.emplace_back([weak = std::weak_ptr(reply)] {
      if (const auto there = weak.lock(); there != nullptr) there->lose();
    });
    ++calls_;
    simulation::start(group_, "call", [this, &parts, reply, handle = std::move(handle)] {
      handle(parts, reply);
      const std::lock_guard done(mutex_);
      --calls_;
      changed_.notify_all();
    });
    return true;
  }

 private:
  void run();
  void lose_calls();

  const server::Config config_;
  const std::filesystem::path folder_;
  int lives_ = 0;
  bool power_failed_ = false;
  std::mutex mutex_;
  std::condition_variable changed_;
  Group group_ = 0;
  const server::ServiceParts* parts_ = nullptr;  // null: down
  bool stops_ = false, ended_ = true;
  int calls_ = 0;
  std::optional<Error> failed_;
  std::vector<std::function<void()>> lose_;
};

}  // namespace marble::simulation
