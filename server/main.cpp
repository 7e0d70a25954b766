// Wires the server: configuration → log → scheduler → services → gRPC server; signals → reload, drain.
#include <absl/synchronization/mutex.h>
#include <grpcpp/server.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <thread>

#include "base/process.h"
#include "calls/jobs_service.h"
#include "calls/solver_service.h"
#include "config/config.h"
#include "fleet/fleet_roster.h"
#include "fleet/fleet_submissions.h"
#include "http/http_server.h"
#include "log/library_log.h"
#include "marble/version.h"
#include "net/hang_up.h"
#include "net/listen.h"
#include "plain_text.h"
#include "process/reload.h"
#include "process/signals.h"
#include "process/supervisor.h"
#include "service/info_service.h"
#include "service/limits.h"
#include "submissions/local_submissions.h"

namespace {

using namespace marble::server;

constexpr int kBadConfiguration = 2;

bool write_lines(const std::string& path, const std::vector<std::string>& lines) {
  // Renamed into place, so that a process that waits for the file never reads half of it.
  const std::string draft = path + ".part";
  {
    std::ofstream file(draft);
    for (const std::string& line : lines) file << line << '\n';
    file.flush();
    if (!file) return false;
  }
  return std::rename(draft.c_str(), path.c_str()) == 0;
}

// Logs the counts of suppressed lines of clients that no longer log any.
class SuppressedLines final : public TimerListener {
 public:
  explicit SuppressedLines(Log& log) : log_(log) {}
  void on_timer(Clock::time_point now) override { log_.report_suppressed(now); }

 private:
  Log& log_;
};

void warn_if_open(const Log& log, const Config& config) {
  if (knows_callers(config)) return;
  for (const std::string& address : addresses_beyond_loopback(config)) {
    log.warn(Component::access, "allow_anonymous",
             {{"address", address}, {"reason", "other machines reach it, and every caller has every role"}});
  }
}

int report(const std::vector<ConfigFault>& faults) {
  for (const ConfigFault& fault : faults)
    std::cerr << "marble-server: " << marble::without_controls(fault.message()) << '\n';
  return kBadConfiguration;
}

int print_new_token(const std::string& name_and_roles) {
  const auto token = new_token(name_and_roles);
  if (!token) return report({{"flag --new-token", token.error()}});
  std::cout << token->secret << '\n' << token->line << '\n';
  return 0;
}

marble::Expected<std::unique_ptr<Submissions>> begin_submissions(const ServiceParts& parts, JobStore* store) {
  if (parts.config.state.empty()) return LocalSubmissions::begin(parts, store);
  return FleetSubmissions::begin(parts);
}

int check_state(const Config& config) {
  if (config.state_dir.empty() && config.state.empty())
    return report({{"flag --check-state", marble::invalid("state_dir", "must be set, or state")}});
  const auto checked = config.state.empty() ? JobStore::check(config.state_dir) : check_fleet(config.state);
  if (!checked) return report({{"state", checked.error()}});
  std::cout << marble::without_controls(*checked) << '\n';
  return 0;
}

// Gives clients that check health time to send their calls elsewhere. A second signal ends this time and the
// grace period.
void announce_shutdown(Scheduler& scheduler, Signals& signals, double notice_s) {
  scheduler.announce_shutdown();
  const auto end = Clock::now() + duration_of(notice_s);
  int signal = SIGHUP;
  while (signal == SIGHUP) signal = signals.wait_for(end - Clock::now());
  if (signal != 0) scheduler.force_shutdown();
}

// Returns when every accepted job has its result. A second signal ends the grace period.
void drain(Scheduler& scheduler, Signals& signals, double grace_s) {
  std::atomic<bool> drained = false;
  std::thread drainer([&] {
    scheduler.drain(std::chrono::duration<double>(grace_s));
    drained = true;
    signals.wake();
  });
  for (int signal = signals.wait(); signal != 0 || !drained; signal = signals.wait()) {
    if (signal != SIGHUP) scheduler.force_shutdown();
  }
  drainer.join();
}

}  // namespace

int main(int argc, char** argv) {
  int exit_code = 0;
  const auto command_line = parse_command_line(argc, argv, exit_code);
  if (!command_line) return exit_code;
  if (!command_line->new_token.empty()) return print_new_token(command_line->new_token);
  if (command_line->print_metrics) {
    std::cout << metrics_markdown();
    return 0;
  }
  // Debian builds Abseil without NDEBUG, where each lock of gRPC is checked against a graph of all others.
  absl::SetMutexDeadlockDetectionMode(absl::OnDeadlockCycle::kIgnore);
  const auto config = load_config(*command_line);
  if (!config) return report(config.error());
  if (command_line->check_state) return check_state(*config);
  if (command_line->print_config || command_line->check_config) {
    std::cout << (command_line->print_config ? to_toml(*config) : "ok\n");
    return 0;
  }
  const Supervisor supervisor;
  Signals signals;
  if (config->stop_at_eof) signals.watch_standard_input();
  Log log(config->log_format, config->log_level, config->log_queue_bytes);
  configure(log, *config);
  const LibraryLog library_log(log);
  warn_if_open(log, *config);
  Access access(*config);
  Metrics metrics(config->metrics, config->metrics_clients);
  LiveCalls calls;
  JobBoard board({config->history_jobs, config->trace_rows, config->trace_pairs});
  FeedLimit feeds(config->watchers);
  std::unique_ptr<JobStore> store;
  if (!config->state_dir.empty()) {
    auto opened = JobStore::open(config->state_dir, log);
    if (!opened) {
      log.error(Component::server, "cannot_use_state",
                {{"state_dir", opened.error().value}, {"reason", opened.error().bound}});
      return kBadConfiguration;
    }
    store = std::move(*opened);
  } else if (config->state.empty()) {
    log.info(Component::server, "jobs_in_memory",
             {{"reason",
               "neither state_dir nor state is set: submitted jobs and their answers end with the server"}});
  }
  ResultStore results(
      result_limits(*config),
      [&store](const std::string& id) {
        if (store != nullptr) store->forget(id);
      },
      [&store](const std::string& id) {
        if (store != nullptr) store->forget_request(id);
      });
  SessionTable sessions({config->sessions, config->session_bytes});
  ConnectionTable connections(connection_limits(*config), log);
  const auto shared_scheduler = std::make_shared<Scheduler>(queue_limits(*config), board, log, metrics);
  Scheduler& scheduler = *shared_scheduler;
  const auto expiry = std::make_shared<ResultExpiry>(results);
  const auto suppressed_lines = std::make_shared<SuppressedLines>(log);
  Timer timer;  // declared after the objects that it calls, so that it ends first
  timer.add(shared_scheduler);
  timer.add(expiry);
  timer.add(suppressed_lines);
  ServiceParts parts{*config, access,  log,       metrics,  timer,       board,
                     feeds,   results, scheduler, sessions, connections, calls};
  const auto submissions = begin_submissions(parts, store.get());
  if (!submissions) {
    log.error(Component::server, "cannot_use_state",
              {{"state", submissions.error().value}, {"reason", submissions.error().bound}});
    return kBadConfiguration;
  }
  parts.submissions = submissions->get();
  std::unique_ptr<FleetRoster> roster;
  if (!config->state.empty()) roster = std::make_unique<FleetRoster>(parts);
  parts.roster = roster.get();
  SolverService solver_service(parts);
  JobsService jobs_service(parts);
  InfoService info_service(parts);

  const auto listening =
      listen(*config, {&solver_service, &jobs_service, &info_service}, log, metrics, connections);
  if (!listening) {
    log.error(Component::server, "cannot_listen",
              {{"address", listening.error().value}, {"reason", listening.error().bound}});
    return 1;
  }
  std::vector<std::string> addresses = listening->addresses;
  std::unique_ptr<HttpServer> http;
  if (config->http != "none") {
    if (auto started = HttpServer::start(parts, listening->acceptor->listeners()); started) {
      http = std::move(*started);
      addresses.push_back(http->address());
    } else if (config->http == "auto") {
      log.warn(Component::http, "no_http",
               {{"address", started.error().value}, {"reason", started.error().bound}});
    } else {
      log.error(Component::server, "cannot_listen",
                {{"address", started.error().value}, {"reason", started.error().bound}});
      return 1;
    }
  }
  if (!config->address_file.empty() && !write_lines(config->address_file, addresses)) {
    log.error(Component::server, "cannot_write", {{"address_file", config->address_file}});
    return 1;
  }
  for (const std::string& address : addresses) {
    log.info(Component::server, "listening",
             {{"address", address},
              {"version", std::string(marble::kVersion)},
              {"workers", std::int64_t{scheduler.limits().workers}},
              {"queue_jobs", std::int64_t{scheduler.limits().jobs}}});
  }

  if (roster != nullptr) roster->start(listening->addresses.front(), http == nullptr ? "" : http->address());
  supervisor.ready();

  Reloader reloader(*command_line, *config, access, log);
  int signal = signals.wait();
  for (; signal == SIGHUP; signal = signals.wait()) {
    supervisor.reloading();
    reloader.reload();
    library_log.follow_level();
    supervisor.ready();
  }
  supervisor.stopping();
  log.info(Component::server, "draining",
           {{"signal", std::int64_t{signal}},
            {"notice_s", config->drain_notice_s},
            {"grace_s", config->drain_grace_s}});
  if (config->drain_notice_s > 0.0) {
    set_serving(*listening->server, false);
    announce_shutdown(scheduler, signals, config->drain_notice_s);
  }
  scheduler.close();  // before health reports it: a client that has seen the status is refused for certain
  set_serving(*listening->server, false);
  drain(scheduler, signals, config->drain_grace_s);
  parts.submissions->close();
  hang_up(*listening, connections, calls);
  http.reset();
  roster.reset();
  log.report_all_suppressed();
  const Counters counters = scheduler.counters();
  log.info(Component::server, "stopped",
           {{"answered", counters.answered},
            {"refused", counters.refused},
            {"cancelled", counters.cancelled},
            {"failed", counters.failed}});
  return 0;
}
