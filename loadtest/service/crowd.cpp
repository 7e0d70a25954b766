// Measures the cost of a thousand idle sessions and a hundred dashboards for active clients.
#include <httplib.h>

#include <atomic>
#include <cstdio>
#include <thread>

#include "bench.h"
#include "closed_loop.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kSessions = 1000;
constexpr int kPages = 50, kWatchers = 50;
constexpr int kClients = 4, kCores = 2;
constexpr int kSteps = 20;
constexpr int kRounds = 10;
constexpr std::chrono::milliseconds kBlock{1500};
constexpr std::chrono::seconds kIdle{3};

// Half of them read as the page does, half by Jobs.Watch.
class Dashboards {
 public:
  explicit Dashboards(const testing::ServerProcess& server) {
    for (int i = 0; i < kPages; ++i) threads_.emplace_back([this, url = server.http()] { view(url); });
    for (int i = 0; i < kWatchers; ++i) {
      const std::unique_ptr<Watcher>& watcher = watchers_.emplace_back(std::make_unique<Watcher>());
      watcher->jobs = v1::Jobs::NewStub(connect(server.address()));
      threads_.emplace_back([this, &watcher = *watcher] { watch(watcher); });
    }
  }
  ~Dashboards() {
    stopping_ = true;
    for (const auto& watcher : watchers_) watcher->context.TryCancel();
  }
  Dashboards(const Dashboards&) = delete;
  Dashboards& operator=(const Dashboards&) = delete;
  [[nodiscard]] std::size_t heard() const { return heard_; }

 private:
  struct Watcher {
    std::unique_ptr<v1::Jobs::Stub> jobs;
    grpc::ClientContext context;
  };
  void view(const std::string& url) {
    httplib::Client client(url);
    client.set_read_timeout(60);
    client.Get("/api/events", [&](const char*, std::size_t bytes) {
      heard_ += bytes;
      return !stopping_;
    });
  }
  void watch(Watcher& watcher) {
    v1::WatchJobsRequest request;
    request.set_progress_interval_s(0.25);  // as often as the page
    const auto reader = watcher.jobs->Watch(&watcher.context, request);
    for (v1::WatchJobsResponse response; reader->Read(&response);) heard_ += response.ByteSizeLong();
    reader->Finish();
  }

  std::atomic<bool> stopping_ = false;
  std::atomic<std::size_t> heard_ = 0;
  std::vector<std::unique_ptr<Watcher>> watchers_;
  std::vector<std::jthread> threads_;  // declared last: they use the others
};

}  // namespace

void crowd() {
  const auto start = [] {
    return start_server({"--workers", "2", "--sessions", "1100", "--http", "127.0.0.1:0", "--client-sessions",
                         "0", "--client-watchers", "0"});
  };
  const testing::ServerProcess crowded = start(), alone = start();
  examples::HopperParameters parameters;
  parameters.steps = 2;
  const OwnedProblem small = examples::hopper(parameters);
  parameters.steps = kSteps;
  const OwnedProblem problem = examples::hopper(parameters);
  const auto channel = connect(crowded.address());
  std::vector<std::unique_ptr<Session>> sessions;
  for (int i = 0; i < kSessions; ++i) sessions.push_back(std::make_unique<Session>(channel, setup_of(small)));
  const Dashboards dashboards(crowded);

  RemoteLoop busy(crowded.address(), problem, kClients), free(alone.address(), problem, kClients);
  static_cast<void>(busy.run(kBlock));
  static_cast<void>(free.run(kBlock));
  // The cost of the crowd while no one solves.
  const auto info = v1::Server::NewStub(connect(crowded.address()));
  const double server_before = server_cpu_s(*info), own_before = own_cpu_s();
  std::this_thread::sleep_for(kIdle);
  const double idle_s = std::chrono::duration<double>(kIdle).count();
  std::printf("nobody solves: %.4f cores for the server, %.4f for its onlookers\n",
              (server_cpu_s(*info) - server_before) / idle_s, (own_cpu_s() - own_before) / idle_s);
  std::vector<double> with, without, with_cpu, without_cpu, with_own, without_own;
  const auto run = [](RemoteLoop& loop, std::vector<double>& rates, std::vector<double>& cpu,
                      std::vector<double>& own) {
    const Block block = loop.run(kBlock);
    rates.push_back(block.accounted_solves_per_s(kCores));
    cpu.push_back(block.server_cpu_per_solve_s());
    own.push_back(block.own_cpu_s / block.seconds);
  };
  for (int round = 0; round < kRounds; ++round) {
    if (round % 2 == 0) run(busy, with, with_cpu, with_own);
    run(free, without, without_cpu, without_own);
    if (round % 2 != 0) run(busy, with, with_cpu, with_own);
  }
  std::printf(
      "%d idle sessions, %d pages and %d watchers, who heard %zu KiB; cores that this process takes: %.4f "
      "beside the crowded server, %.4f beside the other\n",
      kSessions, kPages, kWatchers, dashboards.heard() >> 10, median(with_own), median(without_own));
  const std::string detail = "medians of " + std::to_string(kRounds) +
                             " pairs of blocks in turns, hopper of 20 steps, four clients, two workers";
  report({"1000 idle sessions and 100 dashboards: solves a second over full load alone",
          median(ratios(with, without)), 0.95, false, detail});
  report({"1000 idle sessions and 100 dashboards: server CPU a solve over full load alone",
          median(ratios(with_cpu, without_cpu)), 1.05, true, detail});
  std::printf("\n");
}

}  // namespace marble::bench
