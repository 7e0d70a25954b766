// Servers killed at the moments where a promise could break, with either store: accepted means kept, and is
// answered once.
#include <gmock/gmock.h>

#include <cstdlib>
#include <map>
#include <ostream>

#include "fleet_node.h"
#include "support/postgres_process.h"

namespace marble::testing {
namespace {

struct Moment {
  const char* point;
  const char* store;
};
void PrintTo(const Moment& moment, std::ostream* out) { *out << moment.point << ", " << moment.store; }

class Crash : public ::testing::TestWithParam<Moment> {
 protected:
  /// Dies by itself at the `pass`-th time that it comes by the moment; 0: lives.
  [[nodiscard]] std::unique_ptr<Node> start(int pass) {
    std::vector<std::string> flags = {"--workers", "1", "--job-starts",
                                      "1000"};  // the kills are no job's fault
    if (database_) {
      flags.insert(flags.end(), {"--state", database_->uri(), "--state-lease-s", "1"});
    } else {
      flags.insert(flags.end(), {"--state-dir", directory_.file("state")});
    }
    const std::string fault = std::string(GetParam().point) + ":" + std::to_string(pass);
    setenv("MARBLE_FAULT_POINT", fault.c_str(), 1);
    auto node = std::make_unique<Node>(flags);
    unsetenv("MARBLE_FAULT_POINT");
    return node;
  }

  TemporaryDirectory directory_;
  const std::unique_ptr<PostgresProcess> database_ =
      GetParam().store == std::string("fleet") ? std::make_unique<PostgresProcess>(MARBLE_POSTGRES_DIR)
                                               : nullptr;
};

// Clients that submit and fetch go on at the server that comes after the dead one, as clients do.
TEST_P(Crash, EachAcceptedJobIsAnsweredOnce) {
  constexpr int kCrashes = 3, kPass = 7, kMost = 400;
  const auto other = database_ ? start(0) : nullptr;  // which may have taken what the dead one ran
  auto node = start(kPass);
  int crashes = 0;
  const auto until_done = [&](const auto& call) {
    ASSERT_TRUE(eventually([&] {
      if (call().error_code() != grpc::StatusCode::UNAVAILABLE) return true;
      if (!eventually([&] { return !node->server().running(); }, std::chrono::seconds(10))) return false;
      EXPECT_EQ(node->server().wait(), -SIGKILL) << node->server().log();
      node = start(++crashes < kCrashes ? kPass + crashes : 0);
      return false;
    }));
  };
  std::map<std::string, int> accepted;
  for (int i = 0; i < kMost && crashes < kCrashes; ++i) {
    std::string id;
    until_done([&] { return node->submit(numbered(i), &id); });
    EXPECT_TRUE(accepted.emplace(id, i).second) << "it is a job of its own";
    v1::SolveResponse response;
    until_done([&] { return node->result(id, true, &response); });
    EXPECT_NEAR(response.solution().objective(), 3.0 + i, 1e-9);
  }
  EXPECT_EQ(crashes, kCrashes);
  for (const auto& [id, number] : accepted) {
    expect_answer(*node, id, number);
    EXPECT_EQ(node->submit(numbered(number)), id) << "what was sent again is the same job";
  }
  EXPECT_EQ(node->list().size(), accepted.size());
  if (database_) {
    EXPECT_EQ(database_->ask("SELECT count(*) FROM marble_answers"), std::to_string(accepted.size()));
  }
}

INSTANTIATE_TEST_SUITE_P(Moments, Crash,
                         ::testing::Values(Moment{"before_commit", "one"}, Moment{"after_commit", "one"},
                                           Moment{"before_answer", "one"}, Moment{"within_answer", "one"},
                                           Moment{"before_commit", "fleet"}, Moment{"after_commit", "fleet"},
                                           Moment{"before_answer", "fleet"},
                                           Moment{"within_answer", "fleet"}),
                         [](const auto& moment) {
                           return std::string(moment.param.point) + "_" + moment.param.store;
                         });

}  // namespace
}  // namespace marble::testing
