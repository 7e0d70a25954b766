// One job: its facts, its convergence as curves, its newest rows.
#include <algorithm>
#include <cstdio>

#include "../convergence.h"
#include "../job_report.h"
#include "../terminal/terminal_plot.h"
#include "layout.h"

namespace marble::cli {
namespace {

constexpr int kRoomyHeight = 18;
constexpr int kLeastPlot = 6, kMostPlot = 24;

void fact(Line& line, const char* name, const std::string& text, Style style = Style::plain) {
  if (line.width() > 0) line.add("   ");
  line.add(std::string(name) + " ", Style::faint);
  line.add(text, style);
}

std::string state_text(const JobInfo& job) {
  if (job.state == JobState::finished) return ending(job);
  std::string text = to_string(job.state);
  if (job.state != JobState::queued) return text;
  text += " behind " + std::to_string(job.queue_position);
  return job.estimated_wait_s > 0.0 ? text + ", about " + duration_text(job.estimated_wait_s) : text;
}

Line job_line(const OpenedJob& opened, bool unicode) {
  const JobInfo& job = opened.job;
  Line line;
  fact(line, "job", job.job_id, Style::strong);
  line.add("  " + state_text(job), style_of(job));
  if (opened.gone) line.add("  not known to the server any more", Style::bad);
  fact(line, "problem", shown_text(job.problem_name, unicode));
  return line;
}

Line origin_line(const JobInfo& job, bool unicode) {
  Line line;
  fact(line, "n/n_e/n_i/n_c", sizes_text(job));
  fact(line, "priority", to_string(job.priority));
  fact(line, "client", shown_text(job.client, unicode));
  if (!job.request_id.empty()) fact(line, "request", shown_text(job.request_id, unicode));
  if (job.kind == JobKind::session) fact(line, "updates", std::to_string(job.updates));
  return line;
}

Line work_line(const JobInfo& job) {
  char number[40];
  Line line;
  fact(line, "iterations", std::to_string(job.iterations));
  fact(line, "factorizations", std::to_string(job.factorizations));
  std::snprintf(number, sizeof number, "%.8g", job.objective);
  fact(line, "objective", number);
  std::snprintf(number, sizeof number, "%.1e", largest(job.violations));
  fact(line, "violation", number);
  return line;
}

Line time_line(const JobInfo& job) {
  Line line;
  fact(line, "time", duration_text(job.total_s));
  fact(line, "queue", duration_text(job.queue_s));
  if (job.times.solve_s <= 0.0) return line;  // told with the answer
  fact(line, "set-up", duration_text(job.times.setup_s));
  fact(line, "solve", duration_text(job.times.solve_s));
  fact(line, "of it factorizations", duration_text(job.times.factorization_s));
  fact(line, "line search", duration_text(job.times.line_search_s));
  fact(line, "polish", duration_text(job.times.polish_s));
  return line;
}

// Words broken at blanks into lines of the width.
Lines wrapped(std::string text, int width, std::size_t most, Style style) {
  Lines lines;
  while (!text.empty() && lines.size() < most) {
    const auto limit = static_cast<std::size_t>(std::max(1, width));
    std::size_t end = text.size();
    if (text.size() > limit) {
      end = text.rfind(' ', limit);
      if (end == std::string::npos || end == 0) end = limit;
    }
    lines.emplace_back(text.substr(0, end), style);
    text.erase(0, end);
    text.erase(0, text.find_first_not_of(' '));
  }
  return lines;
}

Lines why_lines(const JobInfo& job, const Look& look) {
  if (job.state != JobState::finished) return {};
  const std::string why = job.error ? job.error->message() : job.detail;
  const std::size_t most = look.size.height >= kRoomyHeight ? 3 : 1;
  return wrapped(shown_text(why, look.unicode), look.size.width, most, style_of(job));
}

Line table_heading() {
  char text[160];
  std::snprintf(text, sizeof text, "%6s %14s %9s %9s %9s %9s %9s %7s %8s %5s", "iter", "objective",
                "equality", "inequal.", "complem.", "residual", "kappa", "step", "regular.", "fact");
  return {text, Style::strong};
}

Line table_row(const Progress& p, bool troubled) {
  char text[200];
  std::snprintf(text, sizeof text, "%6d %14.7e %9.2e %9.2e %9.2e %9.2e %9.2e %7.4f %8.1e %5d", p.iteration,
                p.objective, p.violations.equality, p.violations.inequality, p.violations.complementarity,
                p.kkt_residual, p.kappa, p.step_length, p.regularization, p.factorizations);
  return {text, troubled ? Style::caution : Style::plain};
}

Lines newest_rows(const OpenedJob& opened, int height) {
  if (height < 2 || opened.newest.empty()) return {};
  const std::size_t count = std::min(opened.newest.size(), static_cast<std::size_t>(height - 1));
  Lines lines{table_heading()};
  for (std::size_t i = opened.newest.size() - count; i < opened.newest.size(); ++i) {
    const bool troubled = i > 0 && repeats_factorization(opened.newest[i - 1], opened.newest[i]);
    lines.push_back(table_row(opened.newest[i], troubled));
  }
  return lines;
}

Lines plot(const OpenedJob& opened, const Look& look, int height) {
  std::vector<double> x;
  for (const Progress& row : opened.trace.values()) x.push_back(row.iteration);
  return terminal_plot(x, convergence_summary(opened.trace.values()),
                       {{look.size.width, height}, true, look.unicode});
}

void append(Lines& lines, Lines more) {
  for (Line& line : more) lines.push_back(std::move(line));
}

}  // namespace

Lines job_lines(const OpenedJob& opened, const Look& look, int height) {
  const JobInfo& job = opened.job;
  Lines lines{job_line(opened, look.unicode)};
  if (look.size.height >= kRoomyHeight) lines.push_back(origin_line(job, look.unicode));
  lines.push_back(work_line(job));
  lines.push_back(time_line(job));
  append(lines, why_lines(job, look));
  const int left = height - static_cast<int>(lines.size());
  // The plot takes what it needs, the table the rest.
  const int plot_height = left <= kLeastPlot + 3 ? left : std::clamp(left * 3 / 5, kLeastPlot, kMostPlot);
  append(lines, plot(opened, look, plot_height));
  append(lines, newest_rows(opened, height - static_cast<int>(lines.size())));
  return lines;
}

}  // namespace marble::cli
