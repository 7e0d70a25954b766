#include "watch/model.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <unordered_set>

#include "output/convergence.h"
#include "output/job_report.h"

namespace marble::cli {
namespace {

int rank(const JobInfo& job) {
  switch (job.state) {
    case JobState::running:
      return 0;
    case JobState::queued:
      return 1;
    case JobState::idle:
      return 2;
    case JobState::finished:
      break;
  }
  return 3;
}

bool newer(const JobInfo& a, const JobInfo& b) {
  if (a.accepted_unix_s != b.accepted_unix_s) return a.accepted_unix_s > b.accepted_unix_s;
  return a.job_id > b.job_id;
}

bool more_active(const JobInfo& a, const JobInfo& b) {
  if (rank(a) != rank(b)) return rank(a) < rank(b);
  if (a.state == JobState::queued && a.queue_position != b.queue_position)
    return a.queue_position < b.queue_position;
  return newer(a, b);
}

// Breaks ties by activity, so that rows do not jump.
template <class Key>
auto by(Key key) {
  return [key](const JobRow* a, const JobRow* b) {
    const auto& of_a = key(a->job);
    const auto& of_b = key(b->job);
    return of_a != of_b ? of_a < of_b : more_active(a->job, b->job);
  };
}

double shown_violation(const JobInfo& job) {
  const double worst = largest(job.violations);
  return std::isnan(worst) ? HUGE_VAL : worst;
}

using Before = std::function<bool(const JobRow*, const JobRow*)>;

// Sorts numbers that matter when large in descending order.
Before order_of(SortBy sort) {
  switch (sort) {
    case SortBy::activity:
      break;
    case SortBy::age:
      return [](const JobRow* a, const JobRow* b) { return newer(a->job, b->job); };
    case SortBy::client:
      return by([](const JobInfo& job) -> const std::string& { return job.client; });
    case SortBy::problem:
      return by([](const JobInfo& job) -> const std::string& { return job.problem_name; });
    case SortBy::size:
      return by([](const JobInfo& job) { return -job.variables; });
    case SortBy::priority:
      return by([](const JobInfo& job) { return static_cast<int>(job.priority); });
    case SortBy::state:
      return by([](const JobInfo& job) { return std::to_string(rank(job)) + ending(job); });
    case SortBy::iterations:
      return by([](const JobInfo& job) { return -job.iterations; });
    case SortBy::time:
      return by([](const JobInfo& job) { return -job.total_s; });
    case SortBy::violation:
      return by([](const JobInfo& job) { return -shown_violation(job); });
  }
  return [](const JobRow* a, const JobRow* b) { return more_active(a->job, b->job); };
}

bool same_letter(char a, char b) {
  return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
}

bool holds(const std::string& text, const std::string& part) {
  return std::search(text.begin(), text.end(), part.begin(), part.end(), same_letter) != text.end();
}

bool passes(const JobInfo& job, const std::string& filter) {
  if (filter.empty()) return true;
  return holds(job.job_id, filter) || holds(job.client, filter) || holds(job.problem_name, filter) ||
         holds(to_string(job.state), filter) || holds(ending(job), filter) ||
         holds(to_string(job.priority), filter) || holds(job.request_id, filter);
}

}  // namespace

const char* to_string(SortBy by) {
  constexpr std::array kNames = {"activity", "age",   "client",     "problem", "size",
                                 "priority", "state", "iterations", "time",    "violation"};
  static_assert(kNames.size() == kSortBys);
  return kNames[static_cast<std::size_t>(by)];
}

void JobTable::replace(const std::vector<JobInfo>& jobs) {
  std::unordered_set<std::string> listed;
  for (const JobInfo& job : jobs) listed.insert(job.job_id);
  std::erase_if(rows_, [&](const auto& row) { return !listed.contains(row.first); });
  std::erase_if(finished_, [&](const std::string& id) { return !listed.contains(id); });
  for (auto job = jobs.rbegin(); job != jobs.rend(); ++job) update(*job);
}

void JobTable::update(const JobInfo& job) {
  JobRow& row = rows_[job.job_id];
  const bool had_finished = row.job.state == JobState::finished;
  if (had_finished && job.state != JobState::finished) return;  // older news from another source
  const bool moved = job.iterations != row.reported_iterations;
  row.job = job;
  row.reported_iterations = job.iterations;
  if (moved) row.violations.add(largest(job.violations));
  if (job.state != JobState::finished || had_finished) return;
  finished_.push_back(job.job_id);
  forget_old();
}

void JobTable::forget_old() {
  while (finished_.size() > kMostFinished) {
    rows_.erase(finished_.front());
    finished_.pop_front();
  }
}

const JobRow* JobTable::find(const std::string& job_id) const {
  const auto row = rows_.find(job_id);
  return row == rows_.end() ? nullptr : &row->second;
}

std::vector<const JobRow*> JobTable::rows(const TableView& view) const {
  std::vector<const JobRow*> rows;
  for (const auto& [id, row] : rows_) {
    if (passes(row.job, view.filter)) rows.push_back(&row);
  }
  std::sort(rows.begin(), rows.end(), order_of(view.by));
  if (view.reversed) std::reverse(rows.begin(), rows.end());
  return rows;
}

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
