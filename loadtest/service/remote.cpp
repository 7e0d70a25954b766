// Measures the cost of a remote solver: the same solves remote and in process, in turns.
#include <cstdio>
#include <functional>

#include "bench.h"
#include "echo_server.h"
#include "marble/client.h"
#include "marble/convert.h"
#include "marble/examples.h"
#include "marble/solver.h"
#include "scenario.h"

namespace marble::bench {
namespace {

constexpr int kHopperRounds = 40;
constexpr int kTinyRounds = 80, kTinyBlock = 50;  // alternating blocks of each way
constexpr double kHopperLimit = 1.05;
constexpr double kTinyLimit = 1.3;

Client client_of(const std::string& address) {
  ConnectOptions options;
  options.own_connection = true;
  return Client::connect(address, options).value();
}

// Returns the milliseconds that a piece of work takes.
template <class Work>
double timed_ms(const Work& work) {
  const auto begin = Clock::now();
  work();
  return ms_since(begin);
}

std::string figures(const char* format, double a, double b) {
  char text[200];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

void hopper(const testing::ServerProcess& server) {
  const OwnedProblem problem = examples::hopper();
  Solver local = Solver::create(Problem::create(problem.view()).value()).value();
  const Client client = client_of(server.address());
  marble::Session session = client.open_session(problem.view()).value();
  const ProblemUpdate update{.g = problem.g, .b = problem.b, .d = problem.d, .l = problem.l, .r = problem.r};
  const auto here = [&] {
    must(local.update(update).has_value(), "an update here");
    must(is_solved(local.solve()->status), "a solve here");
  };
  double reported_ms = 0.0;
  const auto there = [&] {
    const auto answer = session.solve(update, {.cold = true});
    must(answer && is_solved(answer->status), "a solve there");
    reported_ms = 1e3 * answer->times.solve_s;
  };
  here();
  there();
  std::vector<double> local_ms, remote_ms, server_ms;
  for (int round = 0; round < kHopperRounds; ++round) {
    local_ms.push_back(timed_ms(here));
    remote_ms.push_back(timed_ms(there));
    server_ms.push_back(reported_ms);
  }
  std::printf(
      "hopper, 60 steps, cold, %d rounds: local %.2f ms, session %.2f ms, of which the server solves %.2f "
      "ms\n",
      kHopperRounds, median(local_ms), median(remote_ms), median(server_ms));
  report({"hopper, session, one client: median latency over local solve",
          median(remote_ms) / median(local_ms), kHopperLimit, true,
          figures("medians: session %.3f ms, local %.3f ms", median(remote_ms), median(local_ms))});
}

// One way to send requests, over one kind of socket.
struct Way {
  const char* name;
  std::function<void()> once;
  std::vector<double> ms = {};
};

void tiny(const testing::ServerProcess& server, std::size_t address, const EchoServer& echo,
          const char* socket) {
  const OwnedProblem problem = load::problems_of(load::single_entry("jr1")).value().front();
  const Client client = client_of(server.addresses().at(address));
  marble::Session session = client.open_session(problem.view()).value();
  const auto echo_stub =
      v1::Solver::NewStub(connect(address == 0 ? echo.tcp_address() : echo.unix_address()));
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  to_message(Options{}, request.mutable_options());
  Solver local = Solver::create(Problem::create(problem.view()).value()).value();
  const ProblemUpdate update{.g = problem.g};

  Way bare{"bare echo",
           [&] {
             grpc::ClientContext context;
             v1::SolveResponse response;
             must(echo_stub->Solve(&context, request, &response), "an echo");
           }},
      unary{"unary", [&] { must(client.solve(problem.view()).has_value(), "a solve"); }},
      in_session{"session", [&] { must(session.solve(update, {.cold = true}).has_value(), "an update"); }},
      here{"here, set up and solved",
           [&] { must(is_solved(solve_in_process(problem.view())->status), "a solve here"); }},
      here_again{"here, updated and solved", [&] {
                   must(local.update(update).has_value(), "an update here");
                   must(local.solve().has_value(), "a solve here");
                 }};
  for (int round = 0; round < kTinyRounds; ++round) {
    for (Way* way : {&bare, &unary, &in_session, &here, &here_again}) {
      for (int i = 0; i < kTinyBlock; ++i) way->ms.push_back(timed_ms(way->once));
    }
  }
  std::printf("jr1 over %s, %d of each, us:", socket, kTinyRounds * kTinyBlock);
  for (const Way* way : {&bare, &unary, &in_session, &here, &here_again})
    std::printf("  %s %.1f", way->name, 1e3 * median(way->ms));
  std::printf("\n");
  const auto overhead = [&](const Way& way, const Way& local_way) {
    const double ms = median(way.ms) - median(local_way.ms);
    report({std::string("jr1, ") + way.name + " over " + socket + ": overhead over a bare echo's latency",
            ms / median(bare.ms), kTinyLimit, true,
            figures("overhead %.1f us, echo %.1f us", 1e3 * ms, 1e3 * median(bare.ms))});
  };
  overhead(in_session, here_again);
  overhead(unary, here);
}

std::string answer_bytes(const testing::ServerProcess& server) {
  const OwnedProblem problem = load::problems_of(load::single_entry("jr1")).value().front();
  v1::SolveRequest request;
  to_message(problem.view(), request.mutable_problem());
  const auto stub = v1::Solver::NewStub(connect(server.address()));
  grpc::ClientContext context;
  v1::SolveResponse response;
  must(stub->Solve(&context, request, &response), "solve");
  return response.SerializeAsString();
}

}  // namespace

void remote() {
  const testing::TemporaryDirectory folder;
  const testing::ServerProcess server = start_server(
      {"--workers", "2", "--listen", "127.0.0.1:0", "--listen", "unix:" + folder.file("socket")});
  const EchoServer echo(answer_bytes(server));
  hopper(server);
  tiny(server, 0, echo, "TCP");
  tiny(server, 1, echo, "a unix socket");
  std::printf("\n");
}

}  // namespace marble::bench
