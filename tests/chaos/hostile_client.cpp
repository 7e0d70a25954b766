// Connections that mean no good: silent, garbage, half messages, endless headers, calls taken back at once,
// pings that nobody reads the answers of. What becomes of them is the server's; nobody else may notice.
#include "clients.h"
#include "problems.h"
#include "support/raw_http2.h"

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
