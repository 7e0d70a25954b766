#include "watch/feed.h"

#include <chrono>
#include <utility>

namespace marble::cli {
namespace {

constexpr double kInterval_s = 0.1;  // between two events of one job: the rate of the screen
constexpr double kServerEvery_s = 1.0;
constexpr int kLooksBetweenLists = 5;
constexpr double kRetryAfter_s = 0.5;
constexpr int kListed = 1000;  // the number that the table keeps

bool drains(const Client& client, const std::stop_token& stop) {
  const auto takes_jobs = client.healthy(stop);
  return takes_jobs && !*takes_jobs;
}

}  // namespace

double steady_now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Feed::Feed(const Client& client, SharedModel& model)
    : client_(client),
      model_(model),
      jobs_([this](const std::stop_token& stop) { follow_jobs(stop); }),
      server_([this](const std::stop_token& stop) { follow_server(stop); }),
      requests_([this](const std::stop_token& stop) { make_requests(stop); }) {}

Feed::~Feed() {  // all at once, not one after the other
  for (std::jthread* thread : {&jobs_, &server_, &requests_, &one_}) thread->request_stop();
}

void Feed::open(const std::string& job_id) {
  close();
  model_.change([&](Model& model) {
    model.opened.emplace();
    model.opened->job.job_id = job_id;
    if (const JobRow* row = model.jobs.find(job_id)) model.opened->job = row->job;
  });
  one_ = std::jthread([this, job_id](const std::stop_token& stop) { follow_one(job_id, stop); });
}

void Feed::close() {
  one_ = {};  // stops and joins
  model_.change([](Model& model) { model.opened.reset(); });
}

void Feed::cancel(std::string job_id) {
  model_.change([&](Model& model) { model.notice = "cancelling " + job_id; });
  const MutexLock lock(mutex_);
  to_cancel_.push_back(std::move(job_id));
  woken_.notify_all();
}

std::optional<Error> Feed::refusal() const {
  const MutexLock lock(mutex_);
  return refusal_;
}

bool Feed::gave_up(const Error& error) {
  const bool final = error.code == ErrorCode::permission_denied || error.code == ErrorCode::unauthenticated;
  const MutexLock lock(mutex_);
  if (final && !refusal_) refusal_ = error;
  return final;
}

void Feed::pause(const std::stop_token& stop, double seconds) {
  const MutexLock lock(mutex_);
  woken_.wait_for(mutex_, stop, std::chrono::duration<double>(seconds), [] { return false; });
}

void Feed::follow_jobs(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto page = client_.jobs().list({.limit = kListed}, stop);
    Error error;
    if (page) {
      model_.change([&](Model& model) { model.jobs.replace(page->jobs); });
      const auto report = [this](const JobEvent& event) {
        model_.change([&](Model& model) { model.jobs.update(event.job); });
      };
      const auto watched = client_.jobs().watch("", report, {kInterval_s, stop});
      error = watched ? failure(ErrorCode::unavailable, "the server ended the stream") : watched.error();
    } else {
      error = page.error();
    }
    if (stop.stop_requested() || gave_up(error)) return;
    model_.change([&](Model& model) { model.server.lost(error.message(), steady_now_s()); });
    pause(stop, kRetryAfter_s);
  }
}

// A list now and then adds what the stream could not report: jobs that finished before it began, or while
// this reader was slow.
void Feed::follow_server(const std::stop_token& stop) {
  for (int looks = 1; !stop.stop_requested(); ++looks) {
    const auto info = client_.info(stop);
    const bool draining = info && drains(client_, stop);
    if (stop.stop_requested() || (!info && gave_up(info.error()))) return;
    model_.change([&](Model& model) {
      if (info) {
        model.server.saw(*info, draining);
      } else {
        model.server.lost(info.error().message(), steady_now_s());
      }
    });
    if (info && looks % kLooksBetweenLists == 0) {
      const auto page = client_.jobs().list({.limit = kListed}, stop);
      if (page) {
        model_.change([&](Model& model) {
          for (auto job = page->jobs.rbegin(); job != page->jobs.rend(); ++job) model.jobs.update(*job);
        });
      }
    }
    pause(stop, kServerEvery_s);
  }
}

void Feed::follow_one(const std::string& job_id, const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const auto report = [this](const JobEvent& event) {
      model_.change([&](Model& model) {
        if (model.opened) model.opened->update(event);
      });
    };
    const auto watched = client_.jobs().watch(job_id, report, {kInterval_s, stop});
    if (watched || stop.stop_requested()) return;
    if (watched.error().code == ErrorCode::not_found) {
      model_.change([](Model& model) {
        if (model.opened) model.opened->gone = true;
      });
      return;
    }
    pause(stop, kRetryAfter_s);
  }
}

std::optional<std::string> Feed::next_to_cancel(const std::stop_token& stop) {
  const MutexLock lock(mutex_);
  const auto any = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return !to_cancel_.empty(); };
  if (!woken_.wait(mutex_, stop, any)) return std::nullopt;
  std::string job_id = std::move(to_cancel_.front());
  to_cancel_.pop_front();
  return job_id;
}

void Feed::make_requests(const std::stop_token& stop) {
  while (const std::optional<std::string> job_id = next_to_cancel(stop)) {
    const auto cancelled = client_.jobs().cancel(*job_id);
    model_.change([&](Model& model) {
      model.notice = cancelled ? "job " + *job_id + " is cancelled"
                               : "job " + *job_id + " is not cancelled: " + cancelled.error().message();
      if (cancelled) model.jobs.update(*cancelled);
    });
  }
}

}  // namespace marble::cli
