#include "service/job_feed.h"

#include <utility>

#include "jobs/progress_slot.h"
#include "marble/convert.h"
#include "service/admission.h"
#include "service/job_access.h"
#include "service/job_message.h"

namespace marble::server {
namespace {

constexpr int kMostEvents = 256;  // limit on one message

double seconds_since(Clock::time_point then, Clock::time_point now) {
  return std::chrono::duration<double>(now - then).count();
}

}  // namespace

Expected<std::unique_ptr<JobFeed>> JobFeed::open(const JobBoard& board, FeedLimit& limit,
                                                 const Identity& viewer, const Quota& quota,
                                                 const v1::WatchJobsRequest& request) {
  MARBLE_RETURN_IF_ERROR(check_progress(request.progress_interval_s(), 0));
  std::shared_ptr<JobRecord> one;
  if (!request.job_id().empty()) {
    MARBLE_ASSIGN_OR_RETURN(one, find_job(board, viewer, request.job_id()));
  }
  MARBLE_RETURN_IF_ERROR(limit.enter(viewer.client, quota.watchers));
  std::unique_ptr<JobFeed> feed(new JobFeed(board, limit, viewer, request.progress_interval_s()));
  if (one != nullptr) one->watch(true);
  feed->one_ = std::move(one);
  feed->finished_ = board.finished();
  return feed;
}

JobFeed::~JobFeed() {
  limit_.leave(viewer_.client);
  if (one_ != nullptr) one_->watch(false);
}

bool JobFeed::next(v1::WatchJobsResponse* response) {
  if (over_) return false;
  return one_ != nullptr ? next_of_one(response) : next_of_all(response);
}

bool JobFeed::next_of_one(v1::WatchJobsResponse* response) {
  const Clock::time_point now = Clock::now();
  const std::int64_t changes = one_->changes();  // read first: later changes are reported next time
  const bool finished = one_->is_finished();
  const bool quiet = now - reported_.at >= ProgressSlot::kQuiet && one_->is_running();
  if (changes == reported_.changes && !finished && !quiet) return false;
  const bool first = reported_.changes < 0;
  const std::int64_t version = one_->snapshot().version;
  if (!first && version == reported_.version && seconds_since(reported_.at, now) < interval_s_) return false;
  v1::JobEvent* event = response->add_events();
  const auto take_rows = [&] {
    if (first) {
      const JobRecord::Trace trace = one_->trace();
      event->clear_trace();
      to_message(trace, event->mutable_trace());
      cursor_ = trace.cursor;
    } else {
      const ProgressHistory::Rows taken = one_->read(cursor_);
      for (const Progress& row : taken.rows) marble::to_message(row, event->add_rows());
      skipped_ += taken.skipped;
    }
  };
  take_rows();
  if (const auto pairs = one_->newest_pairs()) to_message(*pairs, event->mutable_pairs());
  to_message(*one_, event->mutable_job());
  over_ = event->job().state() == v1::JOB_STATE_FINISHED;
  if (over_ && !finished) take_rows();  // it has finished since: this is its last event, with its last rows
  response->set_skipped(skipped_);
  reported_ = {changes, version, now};
  return true;
}

// Finds the jobs that have changed since they were last reported. Reads the finished ones first: a job that
// finishes in between is reported next time, and none is reported twice.
void JobFeed::look_around() {
  const Clock::time_point now = Clock::now();
  JobBoard::Finished finished = board_.finished_since(finished_);
  skipped_ += finished.skipped;
  for (auto& record : finished.records) {
    if (may_see(viewer_, record->description().client)) to_report_.push_back({std::move(record), true});
  }
  renew_active();
  for (std::size_t i = 0; i < active_->size(); ++i) {
    const std::shared_ptr<JobRecord>& record = (*active_)[i];
    Reported& reported = reported_of_[i];
    const std::int64_t changes = record->changes();
    if (changes == reported.changes || !may_see(viewer_, record->description().client)) continue;
    const std::int64_t version = record->snapshot().version;
    const bool waits = seconds_since(reported.at, now) < interval_s_;
    if (reported.changes >= 0 && version == reported.version && waits) continue;
    reported = {changes, version, now};
    to_report_.push_back({record});
  }
}

// Both lists are in order of acceptance, and new jobs come last, so one pass carries over what was reported.
void JobFeed::renew_active() {
  JobBoard::Records active = board_.active();
  if (active == active_) return;
  std::vector<Reported> reported_of(active->size());
  std::size_t before = 0;
  for (std::size_t i = 0; active_ != nullptr && i < active->size(); ++i) {
    while (before < active_->size() && (*active_)[before] != (*active)[i]) ++before;
    if (before == active_->size()) break;
    reported_of[i] = reported_of_[before++];
  }
  active_ = std::move(active);
  reported_of_ = std::move(reported_of);
}

bool JobFeed::next_of_all(v1::WatchJobsResponse* response) {
  if (to_report_.empty()) look_around();
  while (!to_report_.empty() && response->events_size() < kMostEvents) {
    const News news = std::move(to_report_.front());
    to_report_.pop_front();
    const std::shared_ptr<JobRecord>& record = news.record;
    v1::JobEvent* event = response->add_events();
    to_message(*record, event->mutable_job());
    if (event->job().state() == v1::JOB_STATE_FINISHED && !news.last) {
      response->mutable_events()->RemoveLast();  // just finished: found among those next time
      continue;
    }
    if (event->job().state() == v1::JOB_STATE_RUNNING && event->job().iterations() > 0)
      marble::to_message(record->newest(), event->add_rows());
  }
  response->set_skipped(skipped_);
  return response->events_size() > 0;
}

}  // namespace marble::server
