#include "watch/live_view.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>

#include "terminal/signals.h"
#include "watch/feed.h"
#include "watch/layout.h"

namespace marble::cli {
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
