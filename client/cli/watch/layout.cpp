#include "watch/layout.h"

#include <algorithm>
#include <cmath>

#include "output/job_report.h"

namespace marble::cli {
namespace {

constexpr int kRoomyHeight = 14;  // below it, the server's part takes two lines, not four
constexpr int kLongestBar = 20;
constexpr std::size_t kMostNotice = 3;  // lines

std::string memory_text(std::int64_t bytes) {
  const auto mebibytes = static_cast<double>(bytes) / (1 << 20);
  return mebibytes < 1024.0 ? formatted("%.0f MiB", mebibytes) : formatted("%.1f GiB", mebibytes / 1024.0);
}

bool is_roomy(const Size& size) { return size.height >= kRoomyHeight; }

void add_connection(Line& line, const ServerState& server, double now_s) {
  if (!server.connected()) {
    const double lost_s = std::round(std::max(0.0, now_s - server.lost_since_s()));
    line.add("  disconnected, retrying", Style::bad);
    if (lost_s >= 1.0) line.add(" for " + duration_text(lost_s), Style::bad);
  } else if (!server.info()) {
    line.add("  connecting", Style::faint);
  } else if (server.draining()) {
    line.add("  draining", Style::caution);
  } else {
    line.add("  connected", Style::good);
  }
}

// Shows the server, and first of all whether it is reachable.
Line title_line(const Model& model, const View& view, const Look& look) {
  const ServerState& server = model.server;
  Line line("marble", Style::strong);
  if (server.info()) line.add(" " + shown_text(server.info()->version, look.unicode), Style::strong);
  add_connection(line, server, look.now_s);
  if (view.paused) line.add("  paused", Style::caution);
  line.add("  " + shown_text(model.address, look.unicode), Style::strong);
  if (!server.connected()) {
    line.add(": " + shown_text(server.why_lost(), look.unicode), Style::faint);
  } else if (server.info()) {
    line.add("  up " + duration_text(std::floor(std::max(1.0, server.info()->uptime_s))), Style::faint);
  }
  return line;
}

std::string bar(int filled, int all, bool unicode) {
  const int length = std::min(all, kLongestBar);
  const int full = all > 0 ? std::clamp((filled * length + all - 1) / all, 0, length) : 0;
  std::string text;
  for (int i = 0; i < length; ++i) text += i < full ? (unicode ? "█" : "#") : (unicode ? "░" : ".");
  return text;
}

Line workers_line(const ServerInfo& info, const std::optional<Rates>& rates, const Look& look) {
  const int busy = std::min(info.running, info.workers);
  Line line("workers  ", Style::faint);
  line.add(bar(busy, info.workers, look.unicode), Style::active);
  line.add(" " + std::to_string(busy) + " of " + std::to_string(info.workers) + " busy");
  if (!rates) return line;
  line.add("   " + formatted("%.3g", rates->answers_per_s) + " solves/s");
  if (rates->solved_share) {
    const double percent = std::floor(1000.0 * *rates->solved_share) / 10.0;  // 99.99 is not shown as 100
    line.add(", " + formatted("%.4g", percent) + " % solved",
             *rates->solved_share < 0.9 ? Style::caution : Style::plain);
  }
  return line;
}

Line queue_line(const ServerInfo& info) {
  constexpr const char* kNames[] = {"realtime", "interactive", "batch"};
  Line line("queue    ", Style::faint);
  for (std::size_t i = 0; i < info.queued_by_priority.size(); ++i) {
    const int queued = info.queued_by_priority[i];
    line.add(std::string(i > 0 ? "   " : "") + kNames[i] + " ", Style::faint);
    line.add(std::to_string(queued), queued > 0 ? Style::strong : Style::plain);
    if (info.estimated_wait_s[i] > 0.0) line.add(", ~" + duration_text(info.estimated_wait_s[i]));
  }
  return line;
}

Line memory_line(const ServerInfo& info, const std::optional<Rates>& rates) {
  Line line("sessions ", Style::faint);
  line.add(std::to_string(info.sessions));
  line.add("   memory ", Style::faint);
  line.add(memory_text(info.resident_bytes));
  if (rates) {
    line.add("   CPU ", Style::faint);
    line.add(formatted("%.0f %%", 100.0 * rates->cpu_share));
  }
  line.add("   so far ", Style::faint);
  line.add(std::to_string(info.answered + info.updates) + " answers, " + std::to_string(info.refused) +
           " refused, " + std::to_string(info.failed) + " failed");
  return line;
}

// The last lines: a prompt, a notice, or the available keys.
Lines foot(const Model& model, const View& view, const Look& look) {
  if (view.prompt == Prompt::confirm_cancel)
    return {{"cancel job " + shown_text(view.asked_about, look.unicode) + "? y/n", Style::caution}};
  if (view.prompt == Prompt::filter)
    return {{"filter: " + shown_text(view.table.filter, look.unicode) + "_", Style::strong}};
  if (view.help) return {{"any key: back", Style::faint}};
  if (!model.notice.empty())
    return wrapped(shown_text(model.notice, look.unicode), look.size.width, kMostNotice, Style::strong);
  if (!view.opened.empty()) {
    return {
        {std::string(view.began_opened ? "q quit" : "q back") + "  c cancel  p pause  ? help", Style::faint}};
  }
  if (!view.table.filter.empty())
    return {{"only " + shown_text(view.table.filter, look.unicode) + "  Esc shows all  q quit  ? help",
             Style::strong}};
  return {{"q quit  ? help  enter open  c cancel  s sort  r reverse  / filter  p pause", Style::faint}};
}

int server_height(const Size& size) {
  return is_roomy(size) ? 5 : 2;
}  // including a blank line if there is space

Lines body(const Model& model, View& view, const Look& look, int height) {
  if (view.help) return help_lines();
  if (view.opened.empty()) return table_lines(model, view, look, height);
  if (model.opened) return job_lines(*model.opened, look, height);
  return {{"waiting for job " + shown_text(view.opened, look.unicode), Style::faint}};
}

}  // namespace

Style style_of(const JobInfo& job) {
  if (job.state == JobState::running) return Style::active;
  if (job.error) return Style::bad;
  if (job.state != JobState::finished || !job.status) return Style::plain;
  return is_solved(*job.status) ? Style::good : Style::caution;
}

Lines server_lines(const Model& model, const View& view, const Look& look) {
  Lines lines{title_line(model, view, look)};
  const auto& info = model.server.info();
  if (info) {
    lines.push_back(workers_line(*info, model.server.rates(), look));
    if (is_roomy(look.size)) {
      lines.push_back(queue_line(*info));
      lines.push_back(memory_line(*info, model.server.rates()));
    }
  }
  lines.resize(static_cast<std::size_t>(server_height(look.size)));
  return lines;
}

Lines help_lines() {
  return {{"up, down, page up, page down, home, end: select a job", Style::plain},
          {"enter   open it: its facts and its convergence", Style::plain},
          {"c       cancel it, after a question; it takes the role admin, or to be the owner", Style::plain},
          {"s       sort by the next column", Style::plain},
          {"r       the other way round", Style::plain},
          {"/       show only jobs with a text in id, client, problem, state, status or", Style::plain},
          {"        priority; Esc shows all again", Style::plain},
          {"p       pause: what is shown stays as it is", Style::plain},
          {"q, Esc  back, or quit", Style::plain}};
}

std::size_t page_of(const Size& size) {
  return static_cast<std::size_t>(std::max(0, size.height - server_height(size) - 2));  // heading, last line
}

Lines layout(const Model& model, View& view, const Look& look) {
  Lines lines;
  if (view.opened.empty() || view.help) {
    lines = server_lines(model, view, look);
  } else {
    lines = {title_line(model, view, look)};
  }
  Lines last = foot(model, view, look);
  const int above = std::max(0, look.size.height - static_cast<int>(last.size()));
  const int left = std::max(0, above - static_cast<int>(lines.size()));
  append(lines, body(model, view, look, left));
  lines.resize(static_cast<std::size_t>(above));
  append(lines, std::move(last));
  lines.resize(static_cast<std::size_t>(std::max(0, look.size.height)));
  for (Line& line : lines) line.cut_to(look.size.width);
  return lines;
}

}  // namespace marble::cli
