#include <httplib.h>

#include <atomic>
#include <cstdio>
#include <thread>

#include "bench.h"
#include "marble/convert.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kRounds = 30;  // each asks both servers, in turns who is first
constexpr std::chrono::milliseconds kBlock{1000};
constexpr int kClients = 4;  // of one server, on one connection
constexpr double kAim = 0.98;

// What an operator has on: a scraper, and somebody who watches.
class Onlookers {
 public:
  explicit Onlookers(const testing::ServerProcess& server)
      : http_(server.http()), jobs_(v1::Jobs::NewStub(connect(server.address()))) {
    scraper_ = std::jthread([this](const std::stop_token& stop) { scrape(stop); });
    watcher_ = std::jthread([this] { watch(); });
  }
  ~Onlookers() { watching_.TryCancel(); }
  Onlookers(const Onlookers&) = delete;
  Onlookers& operator=(const Onlookers&) = delete;

  [[nodiscard]] int scrapes() const { return scrapes_; }
  [[nodiscard]] int events() const { return events_; }

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

  const std::string http_;
  const std::unique_ptr<v1::Jobs::Stub> jobs_;
  grpc::ClientContext watching_;
  std::atomic<int> scrapes_ = 0, events_ = 0;
  std::jthread scraper_, watcher_;
};

// Clients that ask again as soon as they are answered.
class Load {
 public:
  Load(const std::string& address, const OwnedProblem& problem)
      : problem_(problem), stub_(v1::Solver::NewStub(connect(address))) {
    to_message(problem.view(), request_.mutable_problem());
  }

  /// Solves a second, over a block of time.
  [[nodiscard]] double solves_per_s() {
    std::atomic<int> solves = 0;
    const auto begin = Clock::now();
    {
      std::vector<std::jthread> clients;
      for (int i = 0; i < kClients; ++i) clients.emplace_back([&] { ask(begin + kBlock, solves); });
    }
    return 1e3 * solves / ms_since(begin);
  }

 private:
  void ask(Clock::time_point end, std::atomic<int>& solves) {
    v1::SolveResponse response;
    while (Clock::now() < end) {
      grpc::ClientContext context;
      must(stub_->Solve(&context, request_, &response), "solve");
      ++solves;
    }
    must(is_right(problem_, response.solution()), "a wrong answer");
  }

  const OwnedProblem& problem_;
  v1::SolveRequest request_;
  const std::unique_ptr<v1::Solver::Stub> stub_;
};

}  // namespace

void cost() {
  testing::ServerProcess with = start_server({"--http", "127.0.0.1:0"});
  testing::ServerProcess without =
      start_server({"--metrics=false", "--log-level", "off", "--trace-rows", "0", "--trace-pairs", "0"});
  const OwnedProblem problem = examples::hopper({});
  Load on(with.address(), problem), off(without.address(), problem);
  std::vector<double> on_per_s, off_per_s, ratios;
  int scrapes = 0, events = 0;
  for (int round = -1; round < kRounds; ++round) {  // the first warms up
    const auto ask_on = [&] {
      const Onlookers onlookers(with);
      const double result = on.solves_per_s();
      scrapes += onlookers.scrapes();
      events += onlookers.events();
      return result;
    };
    const bool on_first = round % 2 == 0;
    double with_all = on_first ? ask_on() : 0.0;
    const double without_any = off.solves_per_s();
    if (!on_first) with_all = ask_on();
    if (round < 0) continue;
    on_per_s.push_back(with_all);
    off_per_s.push_back(without_any);
    ratios.push_back(with_all / without_any);
  }
  std::printf(
      "hopper: n = %zu, n_c = %zu; %d clients on one connection ask again as soon as they are answered; "
      "%d rounds of %lld ms on each server; %d scrapes, %d events told to a watcher\n",
      problem.g.size(), problem.l.size(), kClients, kRounds, static_cast<long long>(kBlock.count()), scrapes,
      events);
  std::printf("%-22s %10s %10s %10s\n", "", "p25", "median", "p75");
  const auto print = [](const char* name, const std::vector<double>& values, const char* format) {
    std::printf("%-22s ", name);
    for (const double part : {0.25, 0.5, 0.75}) std::printf(format, quantile(values, part));
    std::printf("\n");
  };
  print("everything on, /s", on_per_s, "%10.1f ");
  print("everything off, /s", off_per_s, "%10.1f ");
  print("on / off", ratios, "%10.4f ");
  const double ratio = median(ratios);
  std::printf("with everything on: %.1f %% of the solves a second: %s\n\n", 100.0 * ratio,
              ratio >= kAim ? "within 2 %" : "BEYOND 2 %");
}

}  // namespace marble::bench
