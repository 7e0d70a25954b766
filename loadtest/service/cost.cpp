#include <httplib.h>

#include <atomic>
#include <cstdio>
#include <thread>

#include "bench.h"
#include "closed_loop.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kRounds = 30;  // each uses both servers, in alternating order
constexpr std::chrono::milliseconds kBlock{1000};
constexpr int kClients = 4;  // of one server, on one connection
constexpr double kAim = 0.98;

// What an operator runs: a scraper, an open page, and a watcher.
class Onlookers {
 public:
  explicit Onlookers(const testing::ServerProcess& server)
      : http_(server.http()), jobs_(v1::Jobs::NewStub(connect(server.address()))) {
    scraper_ = std::jthread([this](const std::stop_token& stop) { scrape(stop); });
    watcher_ = std::jthread([this] { watch(); });
    viewer_ = std::jthread([this](const std::stop_token& stop) { view(stop); });
  }
  ~Onlookers() { watching_.TryCancel(); }
  Onlookers(const Onlookers&) = delete;
  Onlookers& operator=(const Onlookers&) = delete;

  [[nodiscard]] int scrapes() const { return scrapes_; }
  [[nodiscard]] int events() const { return events_; }
  [[nodiscard]] std::size_t page_bytes() const { return page_bytes_; }

 private:
  void scrape(const std::stop_token& stop) {
    httplib::Client client(http_);
    while (!stop.stop_requested()) {
      const auto answer = client.Get("/metrics");
      must(answer && answer->status == 200, "a scrape failed");
      ++scrapes_;
      std::this_thread::sleep_for(std::chrono::seconds(1));
    }
  }
  void watch() {
    const auto reader = jobs_->Watch(&watching_, {});
    for (v1::WatchJobsResponse response; reader->Read(&response);) events_ += response.events_size();
    reader->Finish();
  }

  // As the page does. It receives an event twice a second, and only then notices the end.
  void view(const std::stop_token& stop) {
    httplib::Client client(http_);
    client.Get("/api/events", [&](const char*, std::size_t bytes) {
      page_bytes_ += bytes;
      return !stop.stop_requested();
    });
  }

  const std::string http_;
  const std::unique_ptr<v1::Jobs::Stub> jobs_;
  grpc::ClientContext watching_;
  std::atomic<int> scrapes_ = 0, events_ = 0;
  std::atomic<std::size_t> page_bytes_ = 0;
  std::jthread scraper_, watcher_, viewer_;
};

// Measurements of one server.
struct Side {
  std::vector<double> solves_per_s, cpu_ms;  // cpu_ms: of the server, per solve

  void add(const Block& block) {
    solves_per_s.push_back(block.solves_per_s());
    cpu_ms.push_back(1e3 * block.server_cpu_per_solve_s());
  }
};

void print(const char* name, const std::vector<double>& values, const char* format) {
  std::printf("%-32s ", name);
  for (const double part : {0.25, 0.5, 0.75}) std::printf(format, quantile(values, part));
  std::printf("\n");
}

void compare(const testing::ServerProcess& with, const testing::ServerProcess& without, int steps) {
  examples::HopperParameters parameters;
  parameters.steps = steps;
  const OwnedProblem problem = examples::hopper(parameters);
  RemoteLoop on_load(with.address(), problem, kClients), off_load(without.address(), problem, kClients);
  Side on, off;
  static_cast<void>(on_load.run(kBlock));
  static_cast<void>(off_load.run(kBlock));
  int scrapes = 0, events = 0;
  std::size_t page_bytes = 0;
  const auto run_on = [&] {
    const Onlookers onlookers(with);
    on.add(on_load.run(kBlock));
    scrapes += onlookers.scrapes();
    events += onlookers.events();
    page_bytes += onlookers.page_bytes();
  };
  for (int round = 0; round < kRounds; ++round) {
    if (round % 2 == 0) run_on();
    off.add(off_load.run(kBlock));
    if (round % 2 != 0) run_on();
  }
  std::printf(
      "hopper, %d steps: n = %zu, n_c = %zu; %d clients on one connection; %d blocks of %lld ms on each "
      "server in turn; %d scrapes, %d events reported to a watcher, %zu KiB to a page\n",
      steps, problem.g.size(), problem.l.size(), kClients, kRounds, static_cast<long long>(kBlock.count()),
      scrapes, events, page_bytes >> 10);
  std::printf("%-32s %10s %10s %10s\n", "", "p25", "median", "p75");
  print("everything on, solves/s", on.solves_per_s, "%10.1f ");
  print("everything off, solves/s", off.solves_per_s, "%10.1f ");
  print("on / off", ratios(on.solves_per_s, off.solves_per_s), "%10.4f ");
  print("everything on, CPU ms a solve", on.cpu_ms, "%10.3f ");
  print("everything off, CPU ms a solve", off.cpu_ms, "%10.3f ");
  print("on / off", ratios(on.cpu_ms, off.cpu_ms), "%10.4f ");
  const double ratio = median(ratios(on.solves_per_s, off.solves_per_s));
  const double cpu_ratio = median(ratios(on.cpu_ms, off.cpu_ms));
  report({"hopper of " + std::to_string(steps) + " steps: solves a second with everything on over all off",
          ratio, kAim, false, "for " + std::to_string(cpu_ratio) + " of the CPU time"});
}

}  // namespace

void cost() {
  const testing::ServerProcess with = start_server({"--http", "127.0.0.1:0"});
  const testing::ServerProcess without =
      start_server({"--metrics=false", "--log-level", "off", "--trace-rows", "0", "--trace-pairs", "0"});
  for (const int steps : {60, 10}) compare(with, without, steps);
}

}  // namespace marble::bench
