// Measures the server's work beside solving: the queue, and publishing progress.
#include <benchmark/benchmark.h>

#include <string>
#include <vector>

#include "jobs/job_queue.h"
#include "jobs/job_record.h"
#include "jobs/progress_slot.h"

namespace {

using namespace marble;
using server::JobQueue;

// One job is added and the next one removed, in a queue with the given numbers of jobs and clients.
void BM_QueuePushPop(benchmark::State& state) {
  const auto waiting = state.range(0), clients = state.range(1);
  JobQueue<int> queue({.workers = 1, .jobs = 1 << 20, .bytes = std::int64_t{1} << 40});
  const server::Quota free{};
  std::vector<std::string> names;
  for (std::int64_t i = 0; i < clients; ++i) names.push_back("client-" + std::to_string(i));
  std::size_t next = 0;
  const auto push = [&] {
    const server::Ticket ticket{.client = names[next++ % names.size()], .bytes = 100};
    if (queue.push(std::make_shared<int>(0), ticket, free) != server::QueueRefusal::none)
      state.SkipWithError("refused");
  };
  for (std::int64_t i = 0; i < waiting; ++i) push();
  for (auto _ : state) {
    push();
    queue.done(queue.pop().get());
  }
}
BENCHMARK(BM_QueuePushPop)
    ->ArgNames({"waiting", "clients"})
    ->Args({0, 1})
    ->Args({1000, 1})
    ->Args({1000, 100});

void BM_QueuePlace(benchmark::State& state) {
  JobQueue<int> queue({.workers = 1, .jobs = 1 << 20, .bytes = std::int64_t{1} << 40});
  std::shared_ptr<int> last;
  for (std::int64_t i = 0; i < state.range(0); ++i) {
    last = std::make_shared<int>(0);
    if (queue.push(last, {.client = "client", .bytes = 100}, {}) != server::QueueRefusal::none)
      state.SkipWithError("refused");
  }
  for (auto _ : state) benchmark::DoNotOptimize(queue.ahead_of(last.get()));
}
BENCHMARK(BM_QueuePlace)->ArgName("waiting")->Arg(10)->Arg(1000);

Progress row_of(const std::vector<double>& z) {
  Progress progress;
  progress.z = z;
  return progress;
}

// The worker's cost per iteration while a client streams: of a slot, and of the job's record.
void BM_PublishToSlot(benchmark::State& state) {
  const std::vector<double> z(static_cast<std::size_t>(state.range(0)));
  const Progress progress = row_of(z);
  server::ProgressSlot slot;
  for (auto _ : state) slot.put(progress, false);
}
BENCHMARK(BM_PublishToSlot)->ArgName("n")->Arg(1560);

void BM_PublishToRecord(benchmark::State& state) {
  const std::vector<double> z(static_cast<std::size_t>(state.range(0)));
  const Progress progress = row_of(z);
  server::JobRecord record({.id = "job"}, {}, 256);
  for (auto _ : state) record.report(progress);
}
BENCHMARK(BM_PublishToRecord)->ArgName("n")->Arg(1560);

}  // namespace
