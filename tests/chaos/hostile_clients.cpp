#include "client.h"
#include "grpc/health/v1/health.grpc.pb.h"
#include "problems.h"
#include "support/raw_http2.h"

// Connections that mean no good: silent, garbage, half messages, endless headers, calls taken back at once,
// pings that nobody reads the answers of. What becomes of them is the server's; nobody else may notice.
namespace marble::testing {
namespace {

class HostileClient final : public Client {
 public:
  HostileClient(Environment& environment, std::uint64_t seed) : Client(environment, "hostile", seed) {}

 private:
  void episode() override {
    try {
      RawHttp2 connection(environment().address());
      attack(connection);
      dawdle(200);  // holding what it has
    } catch (const std::runtime_error&) {
      count("nobody there");  // between two servers
    }
  }

  void attack(RawHttp2& connection) {
    static const std::string solve = "/marble.v1.Solver/Solve";
    switch (pick(0, 5)) {
      case 0:
        return count("silent");
      case 1: {
        std::string bytes(static_cast<std::size_t>(pick(1, 100'000)), '\0');
        for (char& byte : bytes) byte = static_cast<char>(pick(0, 255));
        if (chance(0.5)) connection.begin();
        connection.send(bytes);
        return count("garbage");
      }
      case 2: {
        const std::string bytes = long_request().SerializeAsString();
        const std::string half =
            RawHttp2::message(bytes.substr(0, 10'000), static_cast<std::uint32_t>(bytes.size()));
        connection.begin();
        for (std::uint32_t stream = 1; stream < 40; stream += 2) {
          connection.call(stream, solve);
          connection.send(RawHttp2::frame(RawHttp2::kData, RawHttp2::kNone, stream, half));
        }
        return count("half messages");
      }
      case 3: {
        connection.begin();
        connection.send(
            RawHttp2::frame(RawHttp2::kHeaders, RawHttp2::kNone, 1, RawHttp2::call_fields(solve)));
        const std::string more = RawHttp2::fields({{"x", std::string(100, 'y')}});
        std::string block;
        while (block.size() < 16'000) block += more;
        for (int i = 0; i < 50; ++i)
          connection.send(RawHttp2::frame(RawHttp2::kContinuation, RawHttp2::kNone, 1, block));
        return count("endless headers");
      }
      case 4: {
        connection.begin();
        for (std::uint32_t stream = 1; stream < 200; stream += 2) {
          connection.call(stream, solve);
          connection.send(
              RawHttp2::frame(RawHttp2::kReset, RawHttp2::kNone, stream, std::string("\0\0\0\x8", 4)));
        }
        return count("calls taken back");
      }
      default: {
        connection.begin();
        const std::string ping = RawHttp2::frame(RawHttp2::kPing, RawHttp2::kNone, 0, "12345678");
        for (int i = 0; i < 500; ++i) connection.send(ping);
        return count("pings");
      }
    }
  }
};

}  // namespace

std::unique_ptr<Client> make_hostile_client(Environment& environment, std::uint64_t seed) {
  return std::make_unique<HostileClient>(environment, seed);
}

}  // namespace marble::testing

// Health is right throughout, and counters only grow and never show more ends than beginnings.
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
