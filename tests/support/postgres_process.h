// Runs a real PostgreSQL from Debian on a free loopback port, for one test: it can be killed, stopped and
// restarted on the same files.
#pragma once

#include <pwd.h>
#include <unistd.h>

#include <memory>
#include <optional>

#include "child_process.h"
#include "loopback.h"

namespace marble::testing {

class PostgresProcess {
 public:
  /// `programs`: the folder of initdb and postgres. Creates a new database that accepts everyone on this
  /// machine. `synced`: it waits for the disk; without, it survives a kill of the process, but not a crash of
  /// the machine.
  explicit PostgresProcess(std::string programs, bool synced = false, const char* encoding = "UTF8")
      : programs_(std::move(programs)), fsync_(synced ? "fsync=on" : "fsync=off"), port_(free_port()) {
    if (const passwd* const user = getpwnam("nobody"); geteuid() == 0 && user != nullptr) {
      // PostgreSQL refuses to run as root.
      const std::string folder = std::filesystem::path(directory_.file("data")).parent_path();
      if (chown(folder.c_str(), user->pw_uid, user->pw_gid) != 0) throw std::runtime_error("cannot chown");
      as_user_ = {"/usr/bin/setpriv", "--reuid=nobody", "--regid=" + std::to_string(user->pw_gid),
                  "--clear-groups"};
    }
    ChildProcess made(as_user({programs_ + "/initdb", "-D", directory_.file("data"), "-A", "trust", "-U",
                               "marble", "--no-sync", "-E", encoding, "--locale=C"}),
                      directory_.file("initdb.log"));
    if (made.wait() != 0) throw std::runtime_error("initdb failed: " + made.output());
    start();
  }
  ~PostgresProcess() { stop(); }
  PostgresProcess(const PostgresProcess&) = delete;
  PostgresProcess& operator=(const PostgresProcess&) = delete;

  [[nodiscard]] std::string uri() const {
    return "postgresql://marble@127.0.0.1:" + std::to_string(port_) + "/postgres";
  }

  /// Returns when it is ready. After a kill its child processes take a moment to end: retries until they
  /// have.
  void start() {
    const bool ready = eventually([&] {
      const std::string log = directory_.file("log." + std::to_string(++starts_));
      process_ = std::make_unique<ChildProcess>(
          as_user({programs_ + "/postgres", "-D", directory_.file("data"), "-c", "listen_addresses=127.0.0.1",
                   "-c", "port=" + std::to_string(port_), "-c", "unix_socket_directories=", "-c", fsync_}),
          log);
      const bool up = eventually([&] {
        return !process_->running() ||
               process_->output().find("ready to accept connections") != std::string::npos;
      });
      return up && process_->running();
    });
    if (!ready) throw std::runtime_error("PostgreSQL did not start: " + process_->output());
  }
  /// kill -9.
  void kill() { end(SIGKILL); }
  /// As pg_ctl stop -m immediate.
  void stop() { end(SIGQUIT); }
  /// Stops it without a response or a closed connection, as on a machine that hangs.
  void pause() { process_->send(SIGSTOP); }

  /// Runs one statement with psql.
  [[nodiscard]] std::string ask(const std::string& statement) const {
    const std::string file = directory_.file("psql.log");
    std::filesystem::remove(file);
    ChildProcess psql({programs_ + "/psql", uri(), "-qAtc", statement}, file);
    if (psql.wait() != 0) throw std::runtime_error(psql.output());
    std::string text = psql.output();
    if (!text.empty()) text.pop_back();
    return text;
  }

 private:
  void end(int signal) {
    if (process_ == nullptr || !process_->running()) return;
    process_->send(signal);
    process_->wait();
  }
  [[nodiscard]] std::vector<std::string> as_user(std::vector<std::string> command) const {
    command.insert(command.begin(), as_user_.begin(), as_user_.end());
    return command;
  }

  const std::string programs_, fsync_;
  const int port_;
  std::vector<std::string> as_user_;
  TemporaryDirectory directory_;
  int starts_ = 0;
  std::unique_ptr<ChildProcess> process_;
};

}  // namespace marble::testing
