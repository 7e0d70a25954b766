#include "server.h"

#include <string>

#include "disk.h"
#include "service/limits.h"
#include "submissions/local_submissions.h"

namespace marble::simulation {

using namespace marble::server;

// In the order of server/main.cpp.
class Parts {
 public:
  explicit Parts(const Config& config)
      : config_(config),
        access_(config_),
        metrics_(true, 10),
        board_({config.history_jobs, 10, 10}),
        feeds_(config.watchers),
        results_(
            result_limits(config), [this](const std::string& id) { store_->forget(id); },
            [this](const std::string& id) { store_->forget_request(id); }),
        sessions_({config.sessions, config.session_bytes}),
        connections_({}, log_),
        scheduler_(std::make_shared<Scheduler>(queue_limits(config), board_, log_, metrics_)),
        expiry_(std::make_shared<ResultExpiry>(results_)),
        all_{config_, access_,  log_,        metrics_,  timer_,       board_,
             feeds_,  results_, *scheduler_, sessions_, connections_, calls_} {
    timer_.add(scheduler_);
    timer_.add(expiry_);
  }
  [[nodiscard]] Expected<void> begin(const std::string& folder) {
    MARBLE_ASSIGN_OR_RETURN(store_, JobStore::open(folder, log_));
    MARBLE_ASSIGN_OR_RETURN(submissions_, LocalSubmissions::begin(all_, store_.get()));
    all_.submissions = submissions_.get();
    return {};
  }
  [[nodiscard]] const ServiceParts& all() const { return all_; }

 private:
  const Config config_;
  Log log_{"text", "off", 1 << 20};
  Access access_;
  Metrics metrics_;
  LiveCalls calls_;
  JobBoard board_;
  FeedLimit feeds_;
  std::unique_ptr<JobStore> store_;
  ResultStore results_;
  SessionTable sessions_;
  ConnectionTable connections_;
  std::shared_ptr<Scheduler> scheduler_;
  std::shared_ptr<ResultExpiry> expiry_;
  Timer timer_;
  ServiceParts all_;
  std::unique_ptr<Submissions> submissions_;
};

Server::Server(Config config, std::filesystem::path folder)
    : config_(std::move(config)), folder_(std::move(folder)) {}

bool Server::is_up() {
  const std::lock_guard lock(mutex_);
  return parts_ != nullptr;
}

Expected<void> Server::start() {
  const auto before = folder_ / std::to_string(lives_), now = folder_ / std::to_string(lives_ + 1);
  std::filesystem::create_directories(now);
  if (std::filesystem::exists(before)) {
    if (power_failed_) {
      copy_after_power_failure(before, now);
      std::filesystem::remove(now / "running");  // of the last boot: it does not count
    } else {  // what a killed process has written is in the system's cache, and outlives it
      std::filesystem::copy(before, now);
    }
    for (const auto& file : std::filesystem::directory_iterator(now)) {
      if (file.path().string().ends_with("-shm")) std::filesystem::remove(file);
    }
    forget_writes(before);
    std::filesystem::remove_all(before);
  }
  power_failed_ = false;
  std::unique_lock lock(mutex_);
  ++lives_;
  stops_ = ended_ = false;
  failed_.reset();
  calls_ = 0;
  group_ = new_group("server " + std::to_string(lives_));
  simulation::start(group_, "server", [this] { run(); });
  changed_.wait(lock, [&] { return parts_ != nullptr || ended_; });
  if (failed_) return unexpected(*failed_);
  return {};
}

void Server::run() {
  const std::string folder = (folder_ / std::to_string(lives_)).string();
  const auto end = [&](const std::optional<Error>& error) {
    const std::lock_guard lock(mutex_);
    failed_ = error;
    parts_ = nullptr;
    ended_ = true;
    changed_.notify_all();
  };
  auto parts = std::make_unique<Parts>(config_);
  if (const auto begun = parts->begin(folder); !begun) return end(begun.error());
  {
    std::unique_lock lock(mutex_);
    parts_ = &parts->all();
    changed_.notify_all();
    changed_.wait(lock, [&] { return stops_; });
  }
  const ServiceParts& all = parts->all();
  all.scheduler.close();
  all.scheduler.drain(std::chrono::duration<double>(config_.drain_grace_s));
  all.submissions->close();
  {
    std::unique_lock lock(mutex_);
    parts_ = nullptr;
    changed_.wait(lock, [&] { return calls_ == 0; });
  }
  lose_calls();
  parts.reset();
  end({});
}

void Server::stop() {
  std::unique_lock lock(mutex_);
  stops_ = true;
  changed_.notify_all();
  changed_.wait(lock, [&] { return ended_; });
}

void Server::kill(bool power_failure) {
  const Group group = group_;
  power_failed_ = power_failure;
  const auto clean_up = [this, group] {
    if (is_alive(group)) simulation::kill(group);
    {
      const std::lock_guard lock(mutex_);
      parts_ = nullptr;
      ended_ = true;
      changed_.notify_all();
    }
    lose_calls();
  };
  if (current_group() != group) return clean_up();
  // A thread of the server cannot outlive it.
  simulation::start(0, "crash", clean_up);
  simulation::kill(group);
}

void Server::lose_calls() {
  std::vector<std::function<void()>> lose;
  {
    const std::lock_guard lock(mutex_);
    lose.swap(lose_);
  }
  for (const auto& one : lose) one();
}

}  // namespace marble::simulation
