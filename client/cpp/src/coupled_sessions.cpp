// Solves coupled problems whose blocks are sessions, distributed over the servers of a client.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <utility>
#include <vector>

#include "connection/connection.h"
#include "in_process/in_process.h"
#include "marble/client.h"
#include "marble/composite/lifted_block.h"
#include "marble/composite/waiting_threads.h"
#include "transport.h"

namespace marble {
namespace client {
namespace {

constexpr double kForever_s = 1e8;  // no limit is sent

// Shared by all blocks of one solve.
struct Servers {
  const Client& any;          // any server, retried if none accepts
  std::vector<Client> each;   // one server each, tried once
  const BlockSessions& seen;  // how servers see the sessions
  const Options& options;
  std::stop_token stop;
  std::chrono::steady_clock::time_point begun;
  std::atomic<std::size_t> next{0};
  std::atomic<std::int32_t> repeated{0};

  // The time limit counts from the start of the whole solve.
  [[nodiscard]] Options left() const {
    Options limited = options;
    const std::chrono::duration<double> past = std::chrono::steady_clock::now() - begun;
    if (options.time_limit_s < kForever_s)
      limited.time_limit_s = std::max(0.0, options.time_limit_s - past.count());
    return limited;
  }
};

// A session that keeps its memory at the block's server. A set-up has z, but no multipliers: if a block must
// start on the branch of a solution that no session has, its steps are separate solves.
class BlockSession final : public BlockSolver {
 public:
  BlockSession(Servers& servers, const LiftedBlock& block)
      : servers_(servers), block_(block), at_(servers.next++ % servers.each.size()) {}
  BlockSession(const BlockSession&) = delete;
  BlockSession& operator=(const BlockSession&) = delete;
  ~BlockSession() override {
    if (session_ && session_->is_open()) static_cast<void>(session_->close());
  }

  Expected<Solution> solve(const ProblemUpdate& update, const Solution* start) override {
    const bool search = std::exchange(begun_, true) && start == nullptr;
    if (search) return alone(nullptr);
    if (session_ && start != nullptr && start->z != newest_) session_.reset();
    if (session_) {
      auto answer = tick(update);
      if (answer || servers_.stop.stop_requested()) return answer;
      ++servers_.repeated;
      session_.reset();
    }
    if (start == nullptr || block_.problem().l.empty()) {
      open(start);
      if (session_) {
        if (auto answer = tick({}); answer || servers_.stop.stop_requested()) return answer;
        ++servers_.repeated;
        session_.reset();
      }
    }
    return alone(start);
  }

 private:
  // Tries the servers one after the other, starting with the block's server.
  template <class Ask>
  auto anywhere(const Ask& ask) {
    auto answer = ask(servers_.each[at_]);
    for (std::size_t i = 1; !answer && may_be_had_elsewhere(answer.error()) && i < servers_.each.size();
         ++i) {
      at_ = (at_ + 1) % servers_.each.size();
      answer = ask(servers_.each[at_]);
    }
    return answer;
  }

  [[nodiscard]] static bool may_be_had_elsewhere(const Error& error) {
    return error.code == ErrorCode::unavailable || error.code == ErrorCode::resource_exhausted;
  }

  void open(const Solution* start) {
    SessionOptions wanted{.priority = servers_.seen.priority,
                          .problem_name = name(),
                          .traceparent = servers_.seen.traceparent,
                          .stop = servers_.stop};
    if (start != nullptr) wanted.initial_z = start->z;
    auto opened = anywhere([&](const Client& server) {
      return server.open_session(block_.problem().view(), servers_.left(), wanted);
    });
    if (opened) session_.emplace(*std::move(opened));
  }

  [[nodiscard]] Expected<Solution> tick(const ProblemUpdate& update) {
    UpdateControls controls;
    if (servers_.options.time_limit_s < kForever_s) controls.options = servers_.left();
    MARBLE_ASSIGN_OR_RETURN(auto answer, session_->solve(update, controls));
    if (is_solved(answer.status)) newest_ = answer.z;
    return Solution(std::move(answer));
  }

  [[nodiscard]] Expected<Solution> alone(const Solution* start) {
    const auto ask = [&](const Client& server) {
      return server.solve(block_.problem().view(), servers_.left(),
                          {.stop = servers_.stop, .warm_start = start},
                          {.problem_name = name(),
                           .priority = servers_.seen.priority,
                           .traceparent = servers_.seen.traceparent});
    };
    auto answer = anywhere(ask);
    if (!answer && may_be_had_elsewhere(answer.error())) answer = ask(servers_.any);
    if (!answer) return unexpected(std::move(answer.error()));
    return Solution(*std::move(answer));
  }

  [[nodiscard]] std::string name() const {
    const std::string& all = servers_.seen.problem_name;
    return all + (all.empty() || block_.name().empty() ? "" : " ") + block_.name();
  }

  Servers& servers_;
  const LiftedBlock& block_;
  std::size_t at_;  // the block's server
  std::optional<Session> session_;
  std::vector<double> newest_;  // z of the session's last solution
  bool begun_ = false;
};

// Runs `solve(controls)` with the blocks on the servers.
template <class Answer, auto end, class Solve>
Expected<Answer> by_sessions(const Client& any, std::vector<Client> each, const Options& options,
                             const CoupledControls& controls, const BlockSessions& seen, const Solve& solve) {
  CoupledControls own = controls;
  if (!own.begun) own.begun = std::chrono::steady_clock::now();
  WaitingThreads threads;
  Servers servers{any, std::move(each), seen, options, controls.stop, *own.begun};
  if (!servers.each.empty()) {
    own.open = [&servers](const LiftedBlock& block) -> Expected<std::unique_ptr<BlockSolver>> {
      return std::make_unique<BlockSession>(servers, block);
    };
    if (own.runner == nullptr) own.runner = &threads;
  }
  MARBLE_ASSIGN_OR_RETURN(auto solved, solve(own));
  Answer answer{std::move(solved), {}, servers.repeated.load()};
  if ((answer.*end).status == Status::cancelled) return unexpected(given_up());
  return answer;
}

}  // namespace
}  // namespace client

Expected<std::vector<Client>> Client::each() const {
  std::vector<Client> result;
  const std::shared_ptr<const client::Connection> all = transport_->connection();
  if (all == nullptr) return result;
  MARBLE_ASSIGN_OR_RETURN(auto connections, client::Connection::each(all));
  for (auto& connection : connections)
    result.push_back(Client(client::remote_transport(std::move(connection))));
  return result;
}

Expected<RemoteCoupledSolution> Client::solve_coupled_by_sessions(const CoupledView& view,
                                                                  const CoupledOptions& options,
                                                                  const CoupledControls& controls,
                                                                  const BlockSessions& sessions) const {
  return or_out_of_memory([&]() -> Expected<RemoteCoupledSolution> {
    MARBLE_ASSIGN_OR_RETURN(auto servers, each());
    return client::by_sessions<RemoteCoupledSolution, &RemoteCoupledSolution::monolithic>(
        *this, std::move(servers), options.options, controls, sessions,
        [&](const CoupledControls& own) { return marble::solve_coupled(view, options, own); });
  });
}

Expected<RemoteSegmentsSolution> Client::solve_in_segments_by_sessions(
    const Problem& problem, std::span<const Index> stage_of_variable, const SegmentsOptions& options,
    const CoupledControls& controls, const BlockSessions& sessions) const {
  return or_out_of_memory([&]() -> Expected<RemoteSegmentsSolution> {
    MARBLE_ASSIGN_OR_RETURN(auto servers, each());
    return client::by_sessions<RemoteSegmentsSolution, &RemoteSegmentsSolution::whole>(
        *this, std::move(servers), options.coupled.options, controls, sessions,
        [&](const CoupledControls& own) {
          return marble::solve_in_segments(problem, stage_of_variable, options, own);
        });
  });
}

}  // namespace marble
