#include "bench.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "marble/convert.h"
#include "support/independent_check.h"

namespace marble::bench {

constexpr double kTolerance =
    1e-4;  // 100 times the options' default: the meaning of "solved to reduced accuracy"

testing::ServerProcess start_server(const std::vector<std::string>& flags) {
  const auto binary = std::filesystem::read_symlink("/proc/self/exe").parent_path() / "marble-server";
  std::string line = "marble-server";
  for (const std::string& flag : flags) line += " " + flag;
  std::printf("server: %s\n", line.c_str());
  return testing::ServerProcess(binary.string(), flags);
}

std::shared_ptr<grpc::Channel> connect(const std::string& address) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(-1);
  arguments.SetMaxSendMessageSize(-1);
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
}

double ms_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const double at = std::ceil(part * static_cast<double>(values.size())) - 1.0;
  return values[static_cast<std::size_t>(std::max(0.0, at))];
}

bool is_right(const OwnedProblem& problem, const v1::Solution& solution) {
  const Solution found = solution_of(solution);
  return is_solved(found.status) && testing::judge(problem.view(), found).infeasibility() <= kTolerance;
}

void must(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "service_bench: %s\n", what.c_str());
  std::exit(1);
}

void must(const grpc::Status& status, const std::string& what) {
  must(status.ok(), what + ": " + status.error_message());
}

Session::Session(const std::shared_ptr<grpc::Channel>& channel, const v1::SessionSetup& setup,
                 const std::string& client)
    : stub_(v1::Solver::NewStub(channel)) {
  if (!client.empty()) context_.AddMetadata("marble-client", client);
  stream_ = stub_->Session(&context_);
  v1::SessionRequest request;
  *request.mutable_setup() = setup;
  v1::SessionResponse response;
  must(stream_->Write(request) && stream_->Read(&response) && response.has_ready(),
       "a session was not set up");
  ready_ = response.ready();
}

Session::~Session() {
  stream_->WritesDone();
  for (v1::SessionResponse response; stream_->Read(&response);) {
  }
  stream_->Finish();
}

v1::Solution Session::solve(v1::SessionUpdate update) {
  v1::SessionRequest request;
  *request.mutable_update() = std::move(update);
  request.mutable_update()->set_sequence(++sequence_);
  v1::SessionResponse response;
  must(stream_->Write(request) && stream_->Read(&response), "a session broke");
  // Only on failure: building the text takes longer than the round trip.
  if (!response.has_answer()) must(false, "an update has no answer: " + response.ShortDebugString());
  return std::move(*response.mutable_answer()->mutable_solution());
}

v1::SessionSetup setup_of(const OwnedProblem& problem, v1::Priority priority) {
  v1::SessionSetup setup;
  to_message(problem.view(), setup.mutable_problem());
  setup.set_priority(priority);
  return setup;
}

v1::SessionUpdate next_tick(const OwnedProblem& problem, int steps) {
  v1::SessionUpdate update;
  to_message(
      ProblemUpdate{
          .c0 = problem.c0, .g = problem.g, .b = problem.b, .d = problem.d, .l = problem.l, .r = problem.r},
      update.mutable_problem());
  const auto whole = [steps](std::size_t size, v1::ShiftBlock* block) {
    block->set_count(static_cast<int>(size));
    block->set_by(static_cast<int>(size) / steps);
  };
  v1::Shift* shift = update.mutable_shift();
  whole(problem.g.size(), shift->add_variables());
  whole(problem.b.size(), shift->add_equalities());
  whole(problem.d.size(), shift->add_inequalities());
  whole(problem.l.size(), shift->add_pairs());
  return update;
}

namespace {

std::vector<Finding>& findings() {
  static std::vector<Finding> all;
  return all;
}

}  // namespace

void report(Finding finding) {
  std::printf("%-72s %8.4f  %s %-7g %s\n    %s\n", finding.name.c_str(), finding.value,
              finding.at_most ? "<=" : ">=", finding.limit, finding.holds() ? "holds" : "MISSED",
              finding.detail.c_str());
  std::fflush(stdout);
  findings().push_back(std::move(finding));
}

bool write_findings(const std::string& path) {
  auto json = nlohmann::ordered_json::array();
  for (const Finding& finding : findings()) {
    json.push_back({{"name", finding.name},
                    {"value", finding.value},
                    {"limit", finding.limit},
                    {"at_most", finding.at_most},
                    {"holds", finding.holds()},
                    {"detail", finding.detail}});
  }
  std::ofstream file(path);
  file << json.dump(1) << '\n';
  file.close();
  return !file.fail();
}

}  // namespace marble::bench
