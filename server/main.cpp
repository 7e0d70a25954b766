// Wiring: configuration → log → scheduler → services → gRPC server; signals → drain.
#include <grpcpp/server.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <fstream>
#include <thread>

#include "config.h"
#include "info_service.h"
#include "jobs_service.h"
#include "listen.h"
#include "marble/version.h"
#include "solver_service.h"
#include "stop_signals.h"

namespace {

using namespace marble::server;

constexpr std::chrono::seconds kLastAnswers{5};  // for answers on their way to slow readers
constexpr std::chrono::milliseconds kLastRefusals{200};

bool write_lines(const std::string& path, const std::vector<std::string>& lines) {
  // Renamed into place, so that whoever waits for the file never reads half of it.
  const std::string draft = path + ".part";
  {
    std::ofstream file(draft);
    for (const std::string& line : lines) file << line << '\n';
    file.flush();
    if (!file) return false;
  }
  return std::rename(draft.c_str(), path.c_str()) == 0;
}

QueueLimits queue_limits(const Config& config) {
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  return {config.workers > 0 ? config.workers : cores, config.queue_jobs, config.queue_bytes,
          config.passed_over};
}

ResultLimits result_limits(const Config& config) {
  const std::chrono::duration<double> keep(config.result_keep_s);
  return {std::chrono::duration_cast<Clock::duration>(keep), config.result_bytes};
}

// Lets go of answers that were kept long enough.
class ResultExpiry final : public Pulsed {
 public:
  explicit ResultExpiry(ResultStore& results) : results_(results) {}
  void pulse(Clock::time_point now) override { results_.expire(now); }

 private:
  ResultStore& results_;
};

// Returns when every accepted job has its answer. A second signal ends the grace.
void drain(Scheduler& scheduler, StopSignals& signals, double grace_s) {
  std::atomic<bool> drained = false;
  std::thread drainer([&] {
    scheduler.drain(std::chrono::duration<double>(grace_s));
    drained = true;
    signals.wake();
  });
  while (signals.wait() != 0 || !drained) scheduler.hurry();
  drainer.join();
}

}  // namespace

int main(int argc, char** argv) {
  int exit_code = 0;
  const auto config = read_config(argc, argv, exit_code);
  if (!config) return exit_code;
  StopSignals signals;
  const Log log(config->log_format, config->log_level);
  const Access access(*config);
  LiveCalls calls;
  JobBoard board({config->history_jobs, config->trace_rows});
  ResultStore results(result_limits(*config));
  SessionTable sessions({config->sessions, config->session_bytes});
  const auto scheduler_owner = std::make_shared<Scheduler>(queue_limits(*config), board, log);
  Scheduler& scheduler = *scheduler_owner;
  Pulse pulse;  // after what it looks after: it ends first
  const auto housekeeper = std::make_shared<ResultExpiry>(results);
  pulse.add(scheduler_owner);
  pulse.add(housekeeper);
  const ServiceParts parts{*config, access, log, pulse, board, results, scheduler, sessions, calls};
  SolverService solver_service(parts);
  JobsService jobs_service(parts);
  InfoService info_service(parts);

  const auto listening = listen(*config, {&solver_service, &jobs_service, &info_service});
  if (!listening) {
    log.error("cannot_listen", {{"address", listening.error().value}, {"reason", listening.error().bound}});
    return 1;
  }
  if (!config->address_file.empty() && !write_lines(config->address_file, listening->addresses)) {
    log.error("cannot_write", {{"address_file", config->address_file}});
    return 1;
  }
  for (const std::string& address : listening->addresses) {
    log.info("listening", {{"address", address},
                           {"version", std::string(marble::kVersion)},
                           {"workers", std::int64_t{scheduler.limits().workers}},
                           {"queue_jobs", std::int64_t{scheduler.limits().jobs}}});
  }

  const int signal = signals.wait();
  log.info("draining", {{"signal", std::int64_t{signal}}, {"grace_s", config->drain_grace_s}});
  scheduler.close();  // before health says so: whoever has seen it is sure to be refused
  set_serving(*listening->server, false);
  drain(scheduler, signals, config->drain_grace_s);
  calls.wait_for_none(kLastAnswers);
  // gRPC answers a call that arrives during its shutdown with CANCELLED, which nobody retries: until those
  // who have just been answered have asked again and been refused, it waits.
  std::this_thread::sleep_for(kLastRefusals);
  listening->server->Shutdown(std::chrono::system_clock::now());
  listening->server->Wait();
  const Counters counters = scheduler.counters();
  log.info("stopped",
           {{"answered", counters.answered}, {"cancelled", counters.cancelled}, {"failed", counters.failed}});
  return 0;
}
