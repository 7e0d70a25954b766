// Health is right throughout, and counters only grow and never show more ends than beginnings.
#include "clients.h"
#include "grpc/health/v1/health.grpc.pb.h"

namespace marble::testing {
namespace {

namespace health = grpc::health::v1;

class HealthClient final : public Client {
 public:
  HealthClient(Environment& environment, std::uint64_t seed) : Client(environment, "health", seed) {}

 private:
  void connected(const std::shared_ptr<grpc::Channel>& channel) override {
    health_ = health::Health::NewStub(channel);
    info_ = v1::Server::NewStub(channel);
    drains_ = false;
    before_ = {};
  }

  void episode() override {
    health::HealthCheckResponse response;
    const auto context = new_context();
    const grpc::Status status = health_->Check(context.get(), {}, &response);
    if (ended(status, "health")) {
      const bool serving = response.status() == health::HealthCheckResponse::SERVING;
      count(serving ? "SERVING" : "NOT_SERVING");
      expect(serving || disturbed(), "not serving without a reason");
      expect(!(serving && drains_), "serving again while it drains");
      drains_ = drains_ || !serving;
      look_at_counters();
    } else {
      drains_ = true;
    }
    dawdle(20);
  }

  void look_at_counters() {
    const auto context = new_context();
    v1::GetInfoResponse info;
    if (!ended(info_->GetInfo(context.get(), {}, &info), "info")) return;
    const v1::Counters& now = info.counters();
    expect(now.answered_total() + now.cancelled_total() + now.failed_total() <= now.accepted_total(),
           "more jobs ended than were accepted: " + now.ShortDebugString());
    expect(now.running() <= info.workers(), "more solves at once than workers");
    expect(now.accepted_total() >= before_.accepted_total() &&
               now.answered_total() >= before_.answered_total() &&
               now.updates_total() >= before_.updates_total(),
           "counters fell");
    expect(now.queued() >= 0 && now.running() >= 0 && now.sessions() >= 0 && now.session_bytes() >= 0 &&
               now.result_bytes() >= 0,
           "less than nothing: " + now.ShortDebugString());
    before_ = now;
  }

  std::unique_ptr<health::Health::Stub> health_;
  std::unique_ptr<v1::Server::Stub> info_;
  bool drains_ = false;
  v1::Counters before_;
};

}  // namespace

std::unique_ptr<Client> make_health_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<HealthClient>(environment, seed);
}

}  // namespace marble::testing
