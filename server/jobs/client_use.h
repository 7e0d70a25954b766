// Which clients kept the workers busy in the last minutes, in slices of half a minute. No threads, no clock.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace marble::server {

/// A client's use of the workers.
struct ClientUse {
  std::int64_t done = 0;  ///< jobs, and updates of sessions
  double busy_s = 0.0;
};

/// A client's use of the workers now and in the last minutes.
struct ClientShare {
  std::string client;
  int running = 0, queued = 0;
  ClientUse use = {};  ///< including running jobs
};

struct ClientShares {
  static constexpr std::size_t kMost = 64;
  std::vector<ClientShare> clients;  ///< those with the greatest use first, kMost at most
  ClientShare others;                ///< all others together, without a name
  double seconds = 0.0;              ///< length of the period
};

/// Bounded regardless of the names that clients choose: a slice knows kMostClients by name and all others as
/// one.
class ClientUses {
 public:
  using Time = std::chrono::steady_clock::time_point;
  using Uses = std::map<std::string, ClientUse>;
  static constexpr std::size_t kMostClients = 64;
  static constexpr std::int64_t kSliceSeconds = 30;
  static constexpr std::size_t kSlices = 10;
  static constexpr std::int64_t kSeconds = kSliceSeconds * static_cast<std::int64_t>(kSlices);

  /// Returns the length of the period of a sum: the current slice, and those before it.
  [[nodiscard]] static double seconds(Time now) {
    return seconds_of(now) - static_cast<double>((slice_of(now) + 1) * kSliceSeconds - kSeconds);
  }

  struct Sum {
    Uses clients;
    ClientUse others;  ///< use in slices that were full of other names
  };

  /// A worker has worked for this client until now, with or without a result. Time does not go back.
  void add(Time now, const std::string& client, double busy_s, bool answered) {
    std::int64_t number = slice_of(now);
    if (answered) ++use_of(number, client).done;
    double in_slice_s = seconds_of(now) - static_cast<double>(number * kSliceSeconds);
    for (std::size_t back = 0; back < kSlices && busy_s > 0.0; ++back) {
      const double part_s = std::min(busy_s, in_slice_s);
      use_of(number--, client).busy_s += part_s;
      busy_s -= part_s;
      in_slice_s = kSliceSeconds;
    }
  }

  /// Returns the use in the last seconds(now), up to kSeconds.
  [[nodiscard]] Sum sum(Time now) const {
    Sum sum;
    for (const Slice& slice : slices_) {
      if (slice.number <= slice_of(now) - static_cast<std::int64_t>(kSlices)) continue;
      for (const auto& [client, use] : slice.sum.clients) take(sum.clients[client], use);
      take(sum.others, slice.sum.others);
    }
    return sum;
  }

 private:
  struct Slice {
    std::int64_t number = -static_cast<std::int64_t>(kSlices);
    Sum sum;
  };
  // Returns the entry in the slice of this number, whose place no later slice has taken.
  ClientUse& use_of(std::int64_t number, const std::string& client) {
    Slice& slice = slices_[place_of(number)];
    if (slice.number != number) slice = {number, {}};
    const bool known = slice.sum.clients.size() < kMostClients || slice.sum.clients.contains(client);
    return known ? slice.sum.clients[client] : slice.sum.others;
  }
  static void take(ClientUse& into, const ClientUse& use) {
    into.done += use.done;
    into.busy_s += use.busy_s;
  }
  static double seconds_of(Time time) {
    return std::chrono::duration<double>(time.time_since_epoch()).count();
  }
  static std::int64_t slice_of(Time time) {
    return std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count() / kSliceSeconds;
  }
  static std::size_t place_of(std::int64_t slice) { return static_cast<std::size_t>(slice) % kSlices; }

  std::array<Slice, kSlices> slices_ = {};
};

}  // namespace marble::server
