// Estimates how long jobs run from the jobs that ran before them.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <compare>
#include <map>
#include <string>

#include "base/priority.h"

namespace marble::server {

/// Jobs of one client, priority and class of work run for about as long. Keeps a decayed mean and mean
/// deviation for each of these keys, as TCP does for round trips (RFC 6298), and for all clients together,
/// for keys that are new. Pure: no threads, no clock.
class RunEstimates {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Key {
    std::string client;
    Priority priority = Priority::interactive;
    int work_class = 0;
    auto operator<=>(const Key&) const = default;
  };

  /// Records a job that ran to its end.
  void ran(const Key& key, double run_s, Time now) {
    for (const Key& one : {key, everybody(key)}) add(one, run_s, now).old_after = kOld;
  }
  /// Records a job that was stopped after `run_s`: it is known only that it would have taken longer.
  void cut(const Key& key, double run_s, Time now) {
    for (const Key& one : {key, everybody(key)}) {
      const auto known = estimates_.find(one);
      if (known == estimates_.end() || known->second.mean_s < run_s) add(one, run_s, now);
    }
  }

  /// In seconds; 0 if unknown.
  [[nodiscard]] double mean_s(const Key& key) const {
    const Estimate* known = find(key);
    return known == nullptr ? 0.0 : known->mean_s;
  }
  /// Returns the mean plus the deviation: most jobs take no longer.
  [[nodiscard]] double likely_s(const Key& key) const {
    const Estimate* known = find(key);
    return known == nullptr ? 0.0 : known->mean_s + known->deviation_s;
  }
  /// Returns the mean plus four times the deviation, the timeout of RFC 6298: almost no job takes longer.
  [[nodiscard]] double longest_s(const Key& key) const {
    const Estimate* known = find(key);
    return known == nullptr ? 0.0 : known->mean_s + 4.0 * known->deviation_s;
  }
  /// True if the estimate may be outdated, or there is none.
  [[nodiscard]] bool is_old(const Key& key, Time now) const {
    const auto known = estimates_.find(key);
    return known == estimates_.end() || now - known->second.seen >= known->second.old_after;
  }
  /// One job runs against an old estimate, which then does not count as old for a while, for all others.
  /// Without such tries, a single slow run would cause all later jobs to be refused forever. Each try that
  /// does not end confirms the estimate, and doubles the time until the next one.
  void tries(const Key& key, Time now) {
    const auto known = estimates_.find(key);
    if (known == estimates_.end()) return;
    known->second.seen = now;
    known->second.old_after = std::min(2 * known->second.old_after, kOldAtLast);
  }

  [[nodiscard]] std::size_t size() const { return estimates_.size(); }
  static constexpr std::size_t kMost = 4096;  ///< number of estimates that are kept; the oldest is dropped

 private:
  static constexpr std::chrono::steady_clock::duration kOld = std::chrono::seconds(1);
  static constexpr std::chrono::steady_clock::duration kOldAtLast = std::chrono::seconds(16);
  static constexpr double kNewest = 0.125, kNewestDeviation = 0.25;  // weights, those of RFC 6298
  static constexpr double kFarBelow = 0.25;                          // relative to the mean

  struct Estimate {
    double mean_s = 0.0, deviation_s = 0.0;
    Time seen;  // when a job last ended, or was tried against the estimate
    Time::duration old_after = kOld;
  };

  [[nodiscard]] static Key everybody(const Key& key) { return {"", key.priority, key.work_class}; }
  [[nodiscard]] const Estimate* find(const Key& key) const {
    auto known = estimates_.find(key);
    if (known == estimates_.end()) known = estimates_.find(everybody(key));
    return known == estimates_.end() ? nullptr : &known->second;
  }

  Estimate& add(const Key& key, double run_s, Time now) {
    const auto known = estimates_.find(key);
    if (known != estimates_.end()) {
      Estimate& estimate = known->second;
      if (run_s < kFarBelow * estimate.mean_s) {  // the work has changed: the estimate adapts at once
        estimate.mean_s = 0.5 * (estimate.mean_s + run_s);
        estimate.deviation_s = 0.5 * estimate.mean_s;
      } else {
        estimate.deviation_s += kNewestDeviation * (std::abs(run_s - estimate.mean_s) - estimate.deviation_s);
        estimate.mean_s += kNewest * (run_s - estimate.mean_s);
      }
      estimate.seen = now;
      return estimate;
    }
    if (estimates_.size() >= kMost) {
      estimates_.erase(
          std::min_element(estimates_.begin(), estimates_.end(),
                           [](const auto& a, const auto& b) { return a.second.seen < b.second.seen; }));
    }
    return estimates_.emplace(key, Estimate{run_s, 0.5 * run_s, now}).first->second;
  }

  std::map<Key, Estimate> estimates_;
};

}  // namespace marble::server
