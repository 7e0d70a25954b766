// Selects the server of the next call. It knows only how many calls each has in progress, as a proxy does.
#pragma once

#include <random>
#include <set>
#include <utility>
#include <vector>

#include "simulation.h"

namespace marble::fleet_sim {

class Balancer {
 public:
  Balancer(Balance kind, std::uint64_t seed) : kind_(kind), random_(seed) {}

  void add_server() {
    by_load_.emplace(0, static_cast<int>(load_.size()));
    load_.push_back(0);
  }

  [[nodiscard]] int choose() {
    switch (kind_) {
      case Balance::least: {
        // Rotates among the servers with the fewest calls: takes the first one after the last one taken.
        const int least = by_load_.begin()->first;
        auto next = by_load_.lower_bound({least, next_});
        if (next == by_load_.end() || next->first != least) next = by_load_.begin();
        next_ = next->second + 1;
        return next->second;
      }
      case Balance::two: {
        const int first = any(), second = any();
        return load_[first] <= load_[second] ? first : second;
      }
      case Balance::round_robin:
        return next_ = (next_ + 1) % static_cast<int>(load_.size());
      case Balance::random:
        return any();
    }
    return 0;
  }

  void add_call(int server) { change(server, 1); }
  void end_call(int server) { change(server, -1); }

 private:
  int any() { return std::uniform_int_distribution<int>(0, static_cast<int>(load_.size()) - 1)(random_); }
  void change(int server, int by) {
    if (kind_ == Balance::least) {
      by_load_.erase({load_[server], server});
      by_load_.emplace(load_[server] + by, server);
    }
    load_[server] += by;
  }

  Balance kind_;
  std::mt19937_64 random_;
  std::vector<int> load_;
  std::set<std::pair<int, int>> by_load_;
  int next_ = 0;
};

}  // namespace marble::fleet_sim
