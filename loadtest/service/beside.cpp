// Measures a control loop's steps beside other clients' long work, and what the steps cost that work.
#include <atomic>
#include <cstdio>
#include <thread>

#include "bench.h"
#include "closed_loop.h"
#include "control_loop.h"
#include "marble/convert.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kStages = 10, kWorkers = 2;
constexpr int kSteps = 250, kRounds = 3;
constexpr int kQueued = 60;  // hoppers that wait or run
constexpr int kStarts = 500;
constexpr int kBlockSteps = 200, kBlocks = 6;  // of throughput
constexpr int kClients = 4;                    // of throughput
constexpr int kSmallStages = 10;               // many of them in a block
constexpr double kMostFactor = 3.0, kMostMoreMs = 2.0, kLeastThroughput = 0.95;

v1::SolveRequest request_of(const OwnedProblem& problem) {
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  request.set_priority(v1::PRIORITY_BATCH);
  return request;
}

v1::SolveRequest hopper_of(int stages) {
  examples::HopperParameters parameters;
  parameters.steps = stages;
  return request_of(examples::hopper(parameters));
}

// Batch work of another client, sent again as soon as it is answered.
class Work {
 public:
  explicit Work(const std::string& address) : stub_(v1::Solver::NewStub(connect(address))) {}
  ~Work() { stopping_.request_stop(); }
  Work(const Work&) = delete;
  Work& operator=(const Work&) = delete;

  // `clients` of them at a time.
  void add(const v1::SolveRequest& request, int clients = 1) {
    for (int k = 0; k < clients; ++k) threads_.emplace_back([this, request] { repeat(request); });
  }
  [[nodiscard]] int answers() const { return answers_; }

 private:
  void repeat(const v1::SolveRequest& request) {
    while (!stopping_.stop_requested()) {
      grpc::ClientContext context;
      context.AddMetadata("marble-client", "other");
      const std::stop_callback cancel(stopping_.get_token(), [&] { context.TryCancel(); });
      v1::SolveResponse response;
      const grpc::Status status = stub_->Solve(&context, request, &response);
      if (stopping_.stop_requested()) return;
      must(status, "a batch job beside the steps");
      ++answers_;
    }
  }

  const std::unique_ptr<v1::Solver::Stub> stub_;
  std::stop_source stopping_;
  std::atomic<int> answers_ = 0;
  std::vector<std::jthread> threads_;
};

struct Situation {
  const char* name;
  bool global = false, starts = false, queued = false;
  std::vector<double> latency_ms = {};
  int wrong = 0;
};

void measure(Situation& situation) {
  testing::ServerProcess server = start_server({"--workers", std::to_string(kWorkers)});
  ControlLoop loop(server.address(), kStages, v1::PRIORITY_REALTIME, "planner");
  Work work(server.address());
  if (situation.global) {
    v1::SolveRequest request = request_of(examples::gates());
    request.mutable_options()->set_global_search(true);
    work.add(request);
  }
  if (situation.starts) {
    v1::SolveRequest request = hopper_of(examples::HopperParameters().steps);
    request.mutable_options()->set_num_starts(kStarts);
    work.add(request);
  }
  if (situation.queued) work.add(hopper_of(examples::HopperParameters().steps), kQueued);
  if (situation.global || situation.starts || situation.queued)
    std::this_thread::sleep_for(std::chrono::seconds(1));  // until it runs, beyond its set-up
  const ControlLoop::Steps steps = loop.run(kSteps);
  situation.latency_ms.insert(situation.latency_ms.end(), steps.latency_ms.begin(), steps.latency_ms.end());
  situation.wrong += steps.wrong;
}

// Blocks of time with and without steps, in turns. What the steps themselves take of the workers' time cannot
// go to batch work: the limit is a share of the rest.
void measure_throughput() {
  testing::ServerProcess server = start_server({"--workers", std::to_string(kWorkers)});
  ControlLoop loop(server.address(), kStages, v1::PRIORITY_REALTIME, "planner");
  Work work(server.address());
  work.add(hopper_of(kSmallStages), kClients);
  std::this_thread::sleep_for(std::chrono::seconds(1));
  double steps_ms = 0.0;
  const auto block = [&](bool with) {
    const auto begin = Clock::now();
    const int before = work.answers();
    const auto end = begin + kBlockSteps * ControlLoop::kPeriod;
    while (with && Clock::now() < end) {
      const ControlLoop::Steps step = loop.run(1);
      must(step.wrong == 0, "a step is wrong");
      steps_ms += step.latency_ms.front();
    }
    std::this_thread::sleep_until(end);
    return 1e3 * (work.answers() - before) / ms_since(begin);
  };
  std::vector<double> with, without;
  for (int k = 0; k < kBlocks; ++k) {
    without.push_back(block(false));
    with.push_back(block(true));
  }
  const std::chrono::duration<double, std::milli> time = kBlocks * kBlockSteps * ControlLoop::kPeriod;
  const double rest = 1.0 - steps_ms / (kWorkers * time.count());
  char detail[200];
  std::snprintf(
      detail, sizeof detail,
      "hoppers of %d stages, %.1f/s with and %.1f/s without steps (medians of %d blocks); the steps take "
      "%.3f of the workers' time",
      kSmallStages, median(with), median(without), kBlocks, 1.0 - rest);
  report({"batch throughput: with steps over without", median(ratios(with, without)), kLeastThroughput * rest,
          false, detail});
}

}  // namespace

void beside() {
  Situation situations[] = {{.name = "alone"},
                            {.name = "one global search", .global = true},
                            {.name = "one solve with 500 starts", .starts = true},
                            {.name = "60 queued hoppers", .queued = true},
                            {.name = "all of these", .global = true, .starts = true, .queued = true}};
  for (int round = 0; round < kRounds; ++round) {
    for (Situation& situation : situations) measure(situation);
  }
  std::printf("%d steps of a hopper of %d stages, one every %lld ms, in %d turns\n", kRounds * kSteps,
              kStages, static_cast<long long>(ControlLoop::kPeriod.count()), kRounds);
  std::printf("%-28s %8s %8s %8s %8s %6s\n", "beside, ms", "median", "p90", "p99", "max", "wrong");
  for (const Situation& situation : situations) {
    const auto& ms = situation.latency_ms;
    std::printf("%-28s %8.2f %8.2f %8.2f %8.2f %6d\n", situation.name, median(ms), quantile(ms, 0.9),
                quantile(ms, 0.99), worst(ms), situation.wrong);
  }
  const double alone_ms = quantile(situations[0].latency_ms, 0.99);
  for (const Situation& situation : situations) {
    if (&situation == situations) continue;
    char detail[160];
    std::snprintf(detail, sizeof detail, "alone %.2f ms; at most %g x alone + %g ms", alone_ms, kMostFactor,
                  kMostMoreMs);
    report({std::string("p99 of a step beside ") + situation.name + ", ms",
            quantile(situation.latency_ms, 0.99), kMostFactor * alone_ms + kMostMoreMs, true, detail});
  }
  measure_throughput();
  std::printf("\n");
}

}  // namespace marble::bench
