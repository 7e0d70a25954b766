#include "net/hang_up.h"

#include <chrono>
#include <future>
#include <thread>
#include <utility>

#include "base/process.h"

namespace marble::server {
namespace {

using std::chrono::milliseconds;

constexpr std::chrono::seconds kLastAnswers{5};  // time for replies in transit to slow clients
constexpr std::chrono::seconds kLastRefusals{1};
constexpr int kQuietLooks = 2;
constexpr milliseconds kPeriod{5};
constexpr milliseconds kArrival{500};

// Waits until gRPC has read what it had begun to read, and has passed it on. False if that takes too long.
bool wait_until_quiet(ConnectionTable& connections) {
  const auto end = Clock::now() + kLastRefusals;
  std::int64_t taken = -1;
  for (int quiet = 0; quiet < kQuietLooks;) {
    if (Clock::now() >= end) return false;
    std::this_thread::sleep_for(kPeriod);
    const std::int64_t before = std::exchange(taken, connections.taken_bytes());
    quiet = others_wait() && taken == before ? quiet + 1 : 0;
  }
  return true;
}

// gRPC waits for its pending writes, but not forever.
void shut_down(grpc::Server& server, ConnectionTable& connections) {
  std::promise<void> ended;
  std::thread cutter([&, future = ended.get_future()] {
    if (future.wait_for(kArrival) == std::future_status::timeout) connections.cut_all();
  });
  server.Shutdown(std::chrono::system_clock::now());
  server.Wait();
  ended.set_value();
  cutter.join();
}

}  // namespace

void hang_up(const Listening& listening, ConnectionTable& connections, LiveCalls& calls) {
  calls.close();
  calls.wait_for_last(kLastAnswers);
  listening.acceptor->stop();
  // gRPC's shutdown ends a call that it is reading with CANCELLED, which no client retries. Therefore it
  // stops reading, and replies to all that it has read first. Its GOAWAY then names the last call that was
  // seen: a client sends later ones elsewhere by itself.
  connections.hold();
  bool quiet = wait_until_quiet(connections);
  calls.wait_for_last(kLastRefusals);
  quiet = quiet && wait_until_quiet(connections);
  if (quiet) {
    connections.cut_open();
  } else {
    connections.cut_all();  // UNAVAILABLE for late calls
  }
  shut_down(*listening.server, connections);
  // Closing a socket with unread data would discard sent data that has not arrived.
  for (const auto end = Clock::now() + kArrival; Clock::now() < end && !connections.all_arrived();)
    std::this_thread::sleep_for(kPeriod);
}

}  // namespace marble::server
