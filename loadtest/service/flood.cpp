#include <atomic>
#include <cstdio>
#include <thread>
#include <utility>

#include "bench.h"
#include "control_loop.h"
#include "marble/convert.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kTicks = 200;
constexpr int kEqualTicks = 30;  // each waits for the whole queue
constexpr int kFlooders = 8;
constexpr int kFloodSteps = 8;  // about ten milliseconds each
constexpr int kLoopSteps = 20;
const char* const kName = "bench";  // of all clients: fairness between clients must not help

// Endless batches, each a few problems ahead of the results.
class Flood {
 public:
  Flood(const std::string& address, int streams) {
    for (int i = 0; i < streams; ++i) threads_.emplace_back([this, address, i] { run(address, i); });
    while (threads_.size() > 0 && answers_ < 2 * streams)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  ~Flood() { stop(); }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;

  void stop() {
    stopping_ = true;
    for (std::thread& thread : threads_) thread.join();
    threads_.clear();
  }
  [[nodiscard]] int answers() const { return answers_; }
  [[nodiscard]] double longest_ms() const { return longest_ms_; }  // duration of one job on its worker

 private:
  void run(const std::string& address, int number) {
    const auto stub = v1::Solver::NewStub(connect(address));
    grpc::ClientContext context;
    context.AddMetadata("marble-client", kName);
    const auto stream = stub->SolveBatch(&context);
    examples::HopperParameters parameters;
    parameters.steps = kFloodSteps;
    const OwnedProblem problem =
        examples::hopper(examples::vary(parameters, static_cast<std::uint64_t>(number)));
    v1::SolveBatchRequest request;
    to_message(problem.view(), request.mutable_solve()->mutable_problem());
    for (int ahead = 0; ahead < 2; ++ahead) stream->Write(request);
    for (v1::SolveBatchResponse response; stream->Read(&response);) {
      must(response.has_result(), "a flood's problem was refused");
      const v1::Times& times = response.result().solution().times();
      const double ms = 1e3 * (times.total_s() - times.queue_s());
      for (double longest = longest_ms_; ms > longest && !longest_ms_.compare_exchange_weak(longest, ms);) {
      }
      ++answers_;
      if (stopping_) break;
      stream->Write(request);
    }
    context.TryCancel();
    stream->Finish();
  }

  std::atomic<bool> stopping_ = false;
  std::atomic<int> answers_ = 0;
  std::atomic<double> longest_ms_ = 0.0;
  std::vector<std::thread> threads_;
};

struct Ticks {
  std::vector<double> latency_ms;
  int wrong = 0;
  double flood_longest_ms = 0.0;
  double flood_per_s = 0.0;
};

Ticks run(const std::string& address, v1::Priority priority, int flooders, int ticks_wanted) {
  ControlLoop loop(address, kLoopSteps, priority, kName);
  Flood others(address, flooders);
  const auto begin = Clock::now();
  const int answered_before = others.answers();
  ControlLoop::Steps steps = loop.run(ticks_wanted);
  Ticks ticks{std::move(steps.latency_ms), steps.wrong};
  ticks.flood_per_s = 1e3 * (others.answers() - answered_before) / ms_since(begin);
  others.stop();
  ticks.flood_longest_ms = others.longest_ms();
  return ticks;
}

void print(const char* name, const Ticks& ticks) {
  const auto& ms = ticks.latency_ms;
  std::printf("%-28s %8.2f %8.2f %8.2f %8.2f %6d %10.1f %12.1f\n", name, median(ms), quantile(ms, 0.9),
              quantile(ms, 0.99), worst(ms), ticks.wrong, ticks.flood_per_s, ticks.flood_longest_ms);
}

}  // namespace

void flood() {
  testing::ServerProcess server = start_server({"--workers", "2"});
  const Ticks alone = run(server.address(), v1::PRIORITY_REALTIME, 0, kTicks);
  const Ticks flooded = run(server.address(), v1::PRIORITY_REALTIME, kFlooders, kTicks);
  const Ticks equal = run(server.address(), v1::PRIORITY_BATCH, kFlooders, kEqualTicks);
  std::printf(
      "%d ticks (%d where all are equal) of a hopper of %d steps, one every %lld ms at most; flood: %d batch "
      "streams, 2 problems "
      "ahead "
      "each, hoppers of %d steps; all clients of one name\n",
      kTicks, kEqualTicks, kLoopSteps, static_cast<long long>(ControlLoop::kPeriod.count()), kFlooders,
      kFloodSteps);
  std::printf("%-28s %35s %6s %23s\n", "", "tick, ms", "", "flood");
  std::printf("%-28s %8s %8s %8s %8s %6s %10s %12s\n", "", "median", "p90", "p99", "max", "wrong", "solves/s",
              "longest, ms");
  print("alone", alone);
  print("with flood, realtime", flooded);
  print("with flood, batch as well", equal);
  for (const double part : {0.5, 0.99, 1.0}) {
    const double most = quantile(alone.latency_ms, part) + flooded.flood_longest_ms;
    const double now = quantile(flooded.latency_ms, part);
    std::printf("quantile %.2f: %.2f ms with flood, alone + one running solve %.2f ms: %s\n", part, now, most,
                now <= most ? "within" : "BEYOND");
  }
  std::printf("\n");
}

}  // namespace marble::bench
