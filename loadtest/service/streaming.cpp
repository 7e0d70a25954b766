// Measures the cost of reporting every iteration of a solve, to a reader and to one that does not read.
#include <cstdio>
#include <thread>

#include "bench.h"
#include "closed_loop.h"
#include "marble/convert.h"
#include "marble/examples.h"

namespace marble::bench {
namespace {

constexpr int kRounds = 25;
constexpr double kLimit = 1.02;

struct Asked {
  std::vector<double> solve_ms, cpu_ms;
  std::int64_t rows = 0;
};

class Asker {
 public:
  Asker(const std::string& address, const OwnedProblem& problem, const Options& options)
      : stub_(v1::Solver::NewStub(connect(address))), info_(v1::Server::NewStub(connect(address))) {
    v1::SolveRequest& request = *streamed_.mutable_solve();
    to_message(problem.view(), request.mutable_problem());
    to_message(options, request.mutable_options());
  }

  double unary(Asked& asked) {
    const double before = server_cpu_s(*info_);
    grpc::ClientContext context;
    v1::SolveResponse response;
    must(stub_->Solve(&context, streamed_.solve(), &response), "solve");
    add(asked, response.solution(), before);
    return asked.solve_ms.back();
  }

  /// Reads nothing before `stall_ms` have passed.
  void streamed(Asked& asked, double stall_ms) {
    const double before = server_cpu_s(*info_);
    grpc::ClientContext context;
    const auto reader = stub_->SolveStream(&context, streamed_);
    std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(stall_ms));
    v1::SolveStreamResponse event, last;
    while (reader->Read(&event)) {
      asked.rows += event.progress().rows_size();
      last.Swap(&event);
    }
    must(reader->Finish(), "a stream");
    must(last.has_result(), "a stream without a result");
    add(asked, last.result().solution(), before);
  }

 private:
  void add(Asked& asked, const v1::Solution& solution, double cpu_before) {
    asked.solve_ms.push_back(1e3 * solution.times().solve_s());
    asked.cpu_ms.push_back(1e3 * (server_cpu_s(*info_) - cpu_before));
  }
  v1::SolveStreamRequest streamed_;
  const std::unique_ptr<v1::Solver::Stub> stub_;
  const std::unique_ptr<v1::Server::Stub> info_;
};

void compare(const testing::ServerProcess& server, const char* name, const Options& options) {
  Asker asker(server.address(), examples::hopper(), options);
  Asked warm_up, alone, read, stalled;
  const double usual_ms = asker.unary(warm_up);
  for (int round = 0; round < kRounds; ++round) {
    asker.unary(alone);
    asker.streamed(read, 0.0);
    asker.streamed(stalled, 2.0 * usual_ms);
  }
  std::printf("hopper, 60 steps, %s: solve %.2f ms alone, %.2f ms read, %.2f ms stalled; %lld rows a solve\n",
              name, median(alone.solve_ms), median(read.solve_ms), median(stalled.solve_ms),
              static_cast<long long>(read.rows / kRounds));
  const auto finding = [&](const char* reader, const Asked& asked) {
    char detail[200];
    std::snprintf(detail, sizeof detail, "medians of %d in turns; server CPU a solve over unary %.4f",
                  kRounds, median(ratios(asked.cpu_ms, alone.cpu_ms)));
    report({std::string("hopper, ") + name + ", every iteration to " + reader + ": solve time over unary",
            median(ratios(asked.solve_ms, alone.solve_ms)), kLimit, true, detail});
  };
  finding("a reader", read);
  finding("a stalled reader", stalled);
}

}  // namespace

void streaming() {
  const testing::ServerProcess server = start_server({"--workers", "1"});
  compare(server, "path fast", {});
  Options paper;
  paper.path = Path::paper;
  compare(server, "path paper", paper);
  std::printf("\n");
}

}  // namespace marble::bench
