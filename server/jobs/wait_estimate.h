// Estimates how long a job will wait.
#pragma once

#include <algorithm>
#include <vector>

namespace marble::server {

/// Returns the remaining time of a job that has run for `elapsed_s`: half of the mean, or the time that it
/// has already run if that is longer. Never more than `most_s`, the rest of its time limit and deadline.
[[nodiscard]] inline double time_left_s(double mean_s, double elapsed_s, double most_s) {
  return std::clamp(std::max(0.5 * mean_s, elapsed_s), 0.0, std::max(0.0, most_s));
}

/// Returns the time until a worker is free, after the workers have done `work_s` of work together: `busy_s`
/// is the remaining time of each worker's job, in ascending order, 0 if it is idle.
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
