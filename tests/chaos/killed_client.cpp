// Clients that vanish without a word: processes killed with -9.
#include <array>

#include "clients.h"
#include "support/child_process.h"

namespace marble::testing {
namespace {

class KilledClient final : public Client {
 public:
  KilledClient(Environment& environment, std::uint64_t seed) : Client(environment, "killed with -9", seed) {}

 private:
  void episode() override {
    static constexpr std::array kKinds = {"stream", "batch", "session"};
    const std::string kind = kKinds[static_cast<std::size_t>(pick(0, 2))];
    const std::string output = directory_.file(std::to_string(++number_));
    // Of this thread, which lives on: a child is killed with the thread that started it.
    ChildProcess victim({STREAM_CLIENT_BINARY, environment().address(), kind}, output);
    const bool reported = eventually([&] { return !victim.output().empty() || !victim.running(); });
    expect(reported, "a " + kind + " that never ran");
    dawdle(100);
    count(victim.running() ? "killed " + kind : "ended before");
    victim.send(SIGKILL);
    victim.wait();
    std::filesystem::remove(output);
  }

  TemporaryDirectory directory_;
  int number_ = 0;
};

}  // namespace

std::unique_ptr<Client> make_killed_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<KilledClient>(environment, seed);
}

}  // namespace marble::testing
