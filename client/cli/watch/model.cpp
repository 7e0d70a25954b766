#include "watch/model.h"

#include <algorithm>

namespace marble::cli {

std::optional<Rates> rates_between(const ServerInfo& earlier, const ServerInfo& later) {
  const double passed_s = later.uptime_s - earlier.uptime_s;
  if (passed_s <= 0.0) return {};
  const std::int64_t jobs = later.answered - earlier.answered;
  const std::int64_t updates = later.updates - earlier.updates;
  if (jobs < 0 || updates < 0) return {};
  Rates rates;
  const auto answers = static_cast<double>(jobs + updates);
  const auto solved =
      static_cast<double>(later.solved - earlier.solved + later.updates_solved - earlier.updates_solved);
  rates.answers_per_s = answers / passed_s;
  if (answers > 0.0) rates.solved_share = std::clamp(solved / answers, 0.0, 1.0);
  rates.busy_workers = std::max(0.0, later.busy_s - earlier.busy_s) / passed_s;
  rates.cpu_share = std::max(0.0, later.cpu_s - earlier.cpu_s) / passed_s;
  return rates;
}

void ServerState::saw(const ServerInfo& info, bool draining) {
  rates_ = info_ ? rates_between(*info_, info) : std::nullopt;
  info_ = info;
  draining_ = draining;
  why_lost_.clear();
}

void ServerState::lost(const std::string& why, double now_s) {
  if (connected()) lost_since_s_ = now_s;
  why_lost_ = why.empty() ? "no answer" : why;
  rates_.reset();
}

void OpenedJob::update(const JobEvent& event) {
  if (event.trace) {
    trace = {};
    newest.clear();
    for (const Progress& row : event.trace->rows) add(row);
  }
  for (const Progress& row : event.rows) add(row);
  job = event.job;
  skipped = event.skipped;
  gone = false;
}

void OpenedJob::add(const Progress& row) {
  // The next update of a session counts from the start again.
  if (!newest.empty() && row.iteration < newest.back().iteration) trace = {};
  trace.add(without_vectors(row));
  newest.push_back(without_vectors(row));
  if (newest.size() > kNewestRows) newest.pop_front();
}

}  // namespace marble::cli
