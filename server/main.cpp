// Wiring: configuration → log → scheduler → services → gRPC server; signals → drain.
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/health_check_service_interface.h>
#include <pthread.h>

#include <atomic>
#include <csignal>
#include <fstream>
#include <thread>

#include "config.h"
#include "info_service.h"
#include "marble/version.h"
#include "scheduler.h"
#include "solver_service.h"

namespace {

using namespace marble::server;

std::string with_port(const std::string& address, int port) {
  if (address.rfind("unix", 0) == 0) return address;
  return address.substr(0, address.rfind(':') + 1) + std::to_string(port);
}

bool write_lines(const std::string& path, const std::vector<std::string>& lines) {
  // Renamed into place, so that whoever waits for the file never reads half of it.
  const std::string draft = path + ".part";
  {
    std::ofstream file(draft);
    for (const std::string& line : lines) file << line << '\n';
    if (!file) return false;
  }
  return std::rename(draft.c_str(), path.c_str()) == 0;
}

sigset_t block_stop_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals,
                  nullptr);  // inherited by every thread: only main takes them, by waiting
  std::signal(SIGPIPE, SIG_IGN);
  return signals;
}

}  // namespace

int main(int argc, char** argv) {
  int exit_code = 0;
  const auto config = read_config(argc, argv, exit_code);
  if (!config) return exit_code;
  const sigset_t stop_signals = block_stop_signals();
  const Log log(config->log_format, config->log_level);

  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const SchedulerLimits limits{config->workers > 0 ? config->workers : cores, config->queue_jobs,
                               config->queue_bytes};
  Scheduler scheduler(limits, log);
  SolverService solver_service(scheduler, log);
  InfoService info_service(scheduler, *config);

  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT,
                             0);  // a second server on the port must fail, not share it
  builder.SetMaxReceiveMessageSize(static_cast<int>(config->message_bytes));
  builder.SetMaxSendMessageSize(static_cast<int>(config->message_bytes));
  std::vector<int> ports(config->listen.size(), 0);
  for (std::size_t i = 0; i < ports.size(); ++i) {
    builder.AddListeningPort(config->listen[i], grpc::InsecureServerCredentials(), &ports[i]);
  }
  builder.RegisterService(&solver_service);
  builder.RegisterService(&info_service);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  std::vector<std::string> addresses;
  for (std::size_t i = 0; i < ports.size(); ++i) {
    if (server == nullptr || ports[i] == 0) {
      log.error("cannot_listen",
                {{"address", config->listen[i]}, {"reason", "in use, or no address of this machine"}});
      return 1;
    }
    addresses.push_back(with_port(config->listen[i], ports[i]));
  }
  if (!config->address_file.empty() && !write_lines(config->address_file, addresses)) {
    log.error("cannot_write", {{"address_file", config->address_file}});
    return 1;
  }
  for (const std::string& address : addresses) {
    log.info("listening", {{"address", address},
                           {"version", std::string(marble::kVersion)},
                           {"workers", std::int64_t{limits.workers}},
                           {"queue_jobs", std::int64_t{limits.queue_jobs}}});
  }

  int signal = 0;
  sigwait(&stop_signals, &signal);
  log.info("draining", {{"signal", std::int64_t{signal}}, {"grace_s", config->drain_grace_s}});
  server->GetHealthCheckService()->SetServingStatus(false);
  std::atomic<bool> drained = false;
  std::thread drain([&] {
    scheduler.drain(std::chrono::duration<double>(config->drain_grace_s));
    drained = true;
    kill(getpid(), SIGTERM);  // wakes the wait below
  });
  while (sigwait(&stop_signals, &signal), !drained) scheduler.hurry();  // a second signal ends the grace
  drain.join();
  server->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(5));
  server->Wait();
  const Counters counters = scheduler.counters();
  log.info("stopped", {{"answered", counters.answered}, {"cancelled", counters.cancelled}});
  return 0;
}
