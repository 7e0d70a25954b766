// How long a job will wait, as far as anybody can know.
#pragma once

#include <algorithm>
#include <vector>

namespace marble::server {

/// Of a job that has run for `elapsed_s`: half of the mean, and once it is beyond that, as long again as it
/// has run. Never more than `most_s`, which its time limit and its deadline leave it.
[[nodiscard]] inline double time_left_s(double mean_s, double elapsed_s, double most_s) {
  return std::clamp(std::max(0.5 * mean_s, elapsed_s), 0.0, std::max(0.0, most_s));
}

/// Until a worker is free that has done `work_s` of work together with others: `busy_s` tells how long each
/// one still has to do, in ascending order, 0 if it is idle.
[[nodiscard]] inline double wait_for_worker_s(const std::vector<double>& busy_s, double work_s) {
  double least_s = work_s + busy_s.front();
  double sum_s = work_s;
  for (std::size_t workers = 0; workers < busy_s.size();) {
    sum_s += busy_s[workers];
    least_s = std::min(least_s, sum_s / static_cast<double>(++workers));
  }
  return least_s;
}

}  // namespace marble::server
