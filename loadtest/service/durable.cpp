// Measures the cost of storing jobs: in memory, in a file of SQLite, and in PostgreSQL, in turns.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <optional>
#include <thread>

#include "bench.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "support/postgres_process.h"

namespace marble::bench {
namespace {

constexpr const char* kPostgres = "/usr/lib/postgresql/15/bin";
constexpr int kClients[] = {1, 16};  // on one connection
constexpr int kRounds = 6;           // each uses all servers, in turns
constexpr std::chrono::milliseconds kBlock{1500};

// Measurements of one store.
struct Kept {
  std::vector<double> jobs_per_s, submit_ms, answer_ms;
};

class Store {
 public:
  Store(const char* name, std::vector<std::string> flags)
      : name_(name),
        server_(start_server(with_room(std::move(flags)))),
        channel_(connect(server_.address())) {
    to_message(problem_.view(), request_.mutable_problem());
  }

  [[nodiscard]] const char* name() const { return name_; }

  /// Clients that submit, fetch the result, and submit again.
  void run(int clients, Kept& kept) {
    std::mutex mutex;
    const auto begin = Clock::now();
    std::size_t jobs = 0;
    {
      std::vector<std::jthread> threads;
      for (int i = 0; i < clients; ++i) {
        threads.emplace_back([&] {
          Kept own;
          const auto stub = v1::Jobs::NewStub(channel_);
          while (Clock::now() < begin + kBlock) once(*stub, own);
          const std::lock_guard lock(mutex);
          jobs += own.submit_ms.size();
          kept.submit_ms.insert(kept.submit_ms.end(), own.submit_ms.begin(), own.submit_ms.end());
          kept.answer_ms.insert(kept.answer_ms.end(), own.answer_ms.begin(), own.answer_ms.end());
        });
      }
    }
    kept.jobs_per_s.push_back(1e3 * static_cast<double>(jobs) / ms_since(begin));
  }

 private:
  static std::vector<std::string> with_room(std::vector<std::string> flags) {
    flags.insert(flags.end(), {"--workers", "2", "--client-queued", "0", "--log-level", "error"});
    return flags;
  }
  void once(v1::Jobs::Stub& stub, Kept& own) const {
    const auto begin = Clock::now();
    v1::SubmitResponse submitted;
    {
      grpc::ClientContext context;
      must(stub.Submit(&context, request_, &submitted), "Submit");
    }
    own.submit_ms.push_back(ms_since(begin));
    v1::JobResultRequest of;
    of.set_job_id(submitted.job_id());
    of.set_wait(true);
    v1::SolveResponse answer;
    grpc::ClientContext context;
    must(stub.Result(&context, of, &answer), "Result");
    must(is_right(problem_, answer.solution()), "a wrong answer");
    own.answer_ms.push_back(ms_since(begin));
  }

  const char* const name_;
  const OwnedProblem problem_ = examples::hopper({.steps = 2});
  v1::SolveRequest request_;
  testing::ServerProcess server_;
  const std::shared_ptr<grpc::Channel> channel_;
};

}  // namespace

void durable() {
  const testing::TemporaryDirectory folder;
  std::optional<testing::PostgresProcess> database;
  std::vector<std::unique_ptr<Store>> stores;
  stores.push_back(std::make_unique<Store>("memory", std::vector<std::string>()));
  stores.push_back(
      std::make_unique<Store>("SQLite", std::vector<std::string>{"--state-dir", folder.file("state")}));
  if (std::filesystem::exists(kPostgres)) {
    database.emplace(kPostgres, true);
    stores.push_back(
        std::make_unique<Store>("PostgreSQL", std::vector<std::string>{"--state", database->uri()}));
  } else {
    std::printf("PostgreSQL is left out: there is no %s\n", kPostgres);
  }
  std::printf("hopper of 2 steps, submitted and its answer fetched; %d blocks of %lld ms on each in turn\n",
              kRounds, static_cast<long long>(kBlock.count()));
  std::printf("%-12s %8s %10s %12s %12s %12s %12s\n", "store", "clients", "jobs/s", "Submit p50",
              "Submit p99", "answer p50", "answer p99");
  for (const int clients : kClients) {
    std::vector<Kept> kept(stores.size());
    for (int round = 0; round < kRounds; ++round) {
      for (std::size_t i = 0; i < stores.size(); ++i) stores[i]->run(clients, kept[i]);
    }
    for (std::size_t i = 0; i < stores.size(); ++i) {
      std::printf("%-12s %8d %10.1f %9.2f ms %9.2f ms %9.2f ms %9.2f ms\n", stores[i]->name(), clients,
                  median(kept[i].jobs_per_s), median(kept[i].submit_ms), quantile(kept[i].submit_ms, 0.99),
                  median(kept[i].answer_ms), quantile(kept[i].answer_ms, 0.99));
    }
  }
  std::printf("\n");
}

}  // namespace marble::bench
