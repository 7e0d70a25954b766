#include "watch/live_view.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdint>
#include <deque>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "marble/client.h"
#include "mutex.h"
#include "terminal/signals.h"
#include "watch/layout.h"
#include "watch/model.h"

namespace marble::cli {

// Keeps the model in step with the server, on its own threads, and reconnects after a loss.

/// Returns seconds of a steady clock: the clock of the model's times.
[[nodiscard]] double steady_now_s();

/// The model, behind a lock. `change` and `look` must be fast.
class SharedModel {
 public:
  explicit SharedModel(std::string address) { model_.address = std::move(address); }

  template <class Change>
  void change(Change&& change) {
    const MutexLock lock(mutex_);
    change(model_);
    ++version_;
  }
  template <class Look>
  [[nodiscard]] auto look(Look&& look) const {
    const MutexLock lock(mutex_);
    return look(std::as_const(model_));
  }
  /// Returns a number that changes with every change of the model.
  [[nodiscard]] std::int64_t version() const {
    const MutexLock lock(mutex_);
    return version_;
  }

 private:
  mutable Mutex mutex_;
  Model model_ ABSL_GUARDED_BY(mutex_);
  std::int64_t version_ ABSL_GUARDED_BY(mutex_) = 0;
};

class Feed {
 public:
  /// Both must outlive it.
  Feed(const Client& client, SharedModel& model);
  /// Cancels its requests and streams; a requested cancellation of a job is still sent.
  ~Feed();
  Feed(const Feed&) = delete;
  Feed& operator=(const Feed&) = delete;

  /// Follows one job with every row, instead of the previous one.
  void open(const std::string& job_id);
  void close();
  /// Requests the server to cancel a job; the result becomes the model's notice.
  void cancel(std::string job_id);
  /// Returns an error that no retry can fix: the server rejects this caller. The feed has stopped then.
  [[nodiscard]] std::optional<Error> refusal() const;

 private:
  void follow_jobs(const std::stop_token& stop);
  void follow_server(const std::stop_token& stop);
  void follow_one(const std::string& job_id, const std::stop_token& stop);
  void make_requests(const std::stop_token& stop);
  /// Waits for the next one; nothing after a stop once none is left.
  [[nodiscard]] std::optional<std::string> next_to_cancel(const std::stop_token& stop);
  [[nodiscard]] bool gave_up(const Error& error);
  void pause(const std::stop_token& stop, double seconds);

  const Client& client_;
  SharedModel& model_;
  mutable Mutex mutex_;
  std::condition_variable_any woken_;
  std::deque<std::string> to_cancel_ ABSL_GUARDED_BY(mutex_);
  std::optional<Error> refusal_ ABSL_GUARDED_BY(mutex_);
  // Declared last, so that all other members outlive them.
  std::jthread jobs_, server_, requests_, one_;
};

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

namespace {

constexpr double kFrame_s = 0.1;  // at most ten draws a second

class LiveView {
 public:
  LiveView(const Client& client, const std::string& job_id, std::unique_ptr<Screen> screen)
      : model_(client.address()), feed_(client, model_), screen_(std::move(screen)) {
    if (job_id.empty()) return;
    view_.opened = job_id;
    view_.began_opened = true;
    feed_.open(job_id);
  }

  [[nodiscard]] LiveEnd run() {
    while (!over_) {
      wait();
      take_signals();
      if (!over_) take_keys();
      end_.refusal = feed_.refusal();
      over_ = over_ || end_.refusal;
      if (!over_ && steady_now_s() >= drawn_at_s_ + kFrame_s) draw_if_changed();
    }
    end_.job = model_.look(
        [](const Model& model) { return model.opened ? std::optional(model.opened->job) : std::nullopt; });
    return end_;
  }

 private:
  template <class Look>
  auto with_model(Look&& look) {
    return frozen_ ? look(std::as_const(*frozen_)) : model_.look(look);
  }

  // Waits for a key, a signal or the time to check for changes.
  void wait() {
    std::array<pollfd, 2> sources = {{{STDIN_FILENO, POLLIN, 0}, {signals_.descriptor(), POLLIN, 0}}};
    const double left_s = keyed_ ? drawn_at_s_ + kFrame_s - steady_now_s() : kFrame_s;
    poll(sources.data(), sources.size(), static_cast<int>(1e3 * std::clamp(left_s, 0.0, kFrame_s)) + 1);
    if ((sources[0].revents & (POLLHUP | POLLERR | POLLNVAL)) != 0) over_ = true;  // the terminal has closed
  }

  void take_signals() {
    for (int signal = signals_.take(); signal != 0; signal = signals_.take()) {
      if (signal == SIGTSTP) {
        screen_->suspend();
        signals_.stop_here();
        screen_->resume();
        keyed_ = true;
      } else if (signal == SIGCONT) {
        screen_->resume();
        keyed_ = true;
      } else {
        end_.signal = signal;
        over_ = true;
      }
    }
  }

  void take_keys() {
    for (const Key& key : screen_->keys()) {
      keyed_ = true;
      const bool was_paused = view_.paused;
      clear_notice();
      const Request request = with_model([&](const Model& model) {
        return view_.press(key, model.jobs.rows(view_.table), page_of(screen_->size()));
      });
      if (view_.paused != was_paused) pause_or_go_on();
      fulfil(request);
    }
  }

  void fulfil(const Request& request) {
    switch (request.kind) {
      case Request::Kind::none:
        break;
      case Request::Kind::quit:
        over_ = true;
        break;
      case Request::Kind::open:
        feed_.open(request.job_id);
        break;
      case Request::Kind::close:
        feed_.close();
        break;
      case Request::Kind::cancel:
        feed_.cancel(request.job_id);
        break;
    }
    // The request changes the view, so the pause ends.
    if (request.kind != Request::Kind::none && view_.paused) {
      view_.paused = false;
      pause_or_go_on();
    }
  }

  // While paused, the displayed content does not change.
  void pause_or_go_on() {
    frozen_.reset();
    if (view_.paused) frozen_ = model_.look([](const Model& model) { return model; });
  }

  void clear_notice() {
    const bool any = model_.look([](const Model& model) { return !model.notice.empty(); });
    if (any) model_.change([](Model& model) { model.notice.clear(); });
  }

  void draw_if_changed() {
    const Size size = screen_->size();
    const std::int64_t version = frozen_ ? shown_version_ : model_.version();
    if (!keyed_ && size == shown_size_ && version == shown_version_) return;
    shown_size_ = size;
    shown_version_ = version;
    keyed_ = false;
    drawn_at_s_ = steady_now_s();
    screen_->draw(with_model([&](const Model& model) {
      return layout(model, view_, {size, screen_->unicode(), steady_now_s()});
    }));
  }

  SharedModel model_;
  Feed feed_;
  TerminalSignals signals_;
  std::unique_ptr<Screen> screen_;  // destroyed first: the terminal is restored before any wait
  View view_;
  std::optional<Model> frozen_;
  LiveEnd end_;
  bool over_ = false;
  bool keyed_ = false;  // a key or a signal needs a response
  Size shown_size_;
  std::int64_t shown_version_ = -1;
  double drawn_at_s_ = 0.0;
};

}  // namespace

LiveEnd watch_live(const Client& client, const std::string& job_id, std::unique_ptr<Screen> screen) {
  return LiveView(client, job_id, std::move(screen)).run();
}

}  // namespace marble::cli
