// Lays out the table of jobs: which columns fit, and the content of their cells.
#include <algorithm>
#include <array>
#include <cmath>

#include "output/convergence.h"
#include "output/job_report.h"
#include "output/proof.h"
#include "terminal/terminal_plot.h"
#include "watch/layout.h"

namespace marble::cli {
namespace {

enum class Column { job, client, problem, size, priority, state, iterations, time, violation, trend };

struct ColumnRule {
  Column column;
  const char* name;
  int least, most;  // columns of the terminal
  int importance;   // the least important is dropped first if space is short
  int grows;        // the first one gets the free space up to its most, then the next
  bool right;       // right-aligned, for numbers
};

// In display order.
constexpr std::array kRules = {
    ColumnRule{Column::job, "job", 8, 16, 9, 7, false},
    ColumnRule{Column::client, "client", 6, 14, 2, 2, false},
    ColumnRule{Column::problem, "problem", 7, 16, 5, 1, false},
    ColumnRule{Column::size, "n/n_c", 8, 11, 1, 3, true},
    ColumnRule{Column::priority, "prio", 5, 11, 0, 6, false},
    ColumnRule{Column::state, "state", 9, 18, 8, 0, false},
    ColumnRule{Column::iterations, "iter", 5, 7, 4, 5, true},
    ColumnRule{Column::time, "time", 7, 7, 7, 8, true},
    ColumnRule{Column::violation, "violation", 9, 9, 6, 9, true},
    ColumnRule{Column::trend, "trend", 8, 32, 3, 4, false},
};
constexpr int kOrders = static_cast<int>(kRules.size());
using Widths = std::array<int, kRules.size()>;  // 0: not shown

int total(const Widths& widths) {
  int sum = 0, shown = 0;
  for (const int width : widths) {
    sum += width;
    shown += width > 0 ? 1 : 0;
  }
  return sum + std::max(0, shown - 1);  // a blank between two
}

// Depends only on the terminal, so that columns do not move while jobs come and go.
Widths widths_for(int width) {
  Widths widths;
  for (std::size_t i = 0; i < kRules.size(); ++i) widths[i] = kRules[i].least;
  for (int importance = 0; importance < 9 && total(widths) > width; ++importance) {
    for (std::size_t i = 0; i < kRules.size(); ++i) {
      if (kRules[i].importance == importance) widths[i] = 0;
    }
  }
  for (int order = 0; order < kOrders; ++order) {
    for (std::size_t i = 0; i < kRules.size(); ++i) {
      if (widths[i] == 0 || kRules[i].grows != order) continue;
      widths[i] += std::clamp(width - total(widths), 0, kRules[i].most - widths[i]);
    }
  }
  return widths;
}

std::string priority_text(Priority priority, int width) {
  const std::string name = to_string(priority);
  return width < 11 ? name.substr(0, priority == Priority::realtime ? 4 : 5) : name;
}

std::string state_text(const JobInfo& job) {
  if (job.state == JobState::queued) return "queued " + std::to_string(job.queue_position);
  if (job.state == JobState::finished) return ending(job);
  const std::string state = to_string(job.state);
  if (!job.activity || job.activity->total == 0) return state;
  return state + " " + std::to_string(job.activity->done) + "/" + std::to_string(job.activity->total);
}

// For a tree, in the nine columns of a violation.
std::string gap_text(const JobInfo& job) {
  if (job.proved) return "proved";
  if (!std::isfinite(job.gap)) return "no gap";
  if (job.gap < 1e-3) return "gap " + formatted("%.0e", job.gap);
  return "gap " + formatted(job.gap < 0.1 ? "%.2g%%" : "%.0f%%", 100.0 * job.gap);
}

std::string violation_text(const JobInfo& job) {
  const bool solved = job.status && is_solved(*job.status);
  if (job.nodes > 0 && (!solved || std::isfinite(job.gap))) return gap_text(job);
  if (job.iterations == 0) return "-";
  return formatted("%.1e", largest(job.violations));
}

std::string cell_text(const JobRow& row, Column column, int width, bool unicode) {
  const JobInfo& job = row.job;
  switch (column) {
    case Column::job:
      return job.job_id.substr(0, static_cast<std::size_t>(width));
    case Column::client:
      return shown_text(job.client, unicode);
    case Column::problem:
      return shown_text(job.problem_name, unicode);
    case Column::size:
      return std::to_string(job.variables) + "/" + std::to_string(job.pairs);
    case Column::priority:
      return priority_text(job.priority, width);
    case Column::state:
      return state_text(job);
    case Column::iterations:
      return std::to_string(job.iterations);
    case Column::time:
      return job.total_s > 0.0 ? duration_text(job.total_s) : "-";
    case Column::violation:
      return violation_text(job);
    case Column::trend:
      if (job.nodes > 0) return whole_text(job.nodes) + (job.nodes == 1 ? " node" : " nodes");
      return sparkline(row.violations.values(), width, unicode);
  }
  return "";
}

void add_cell(Line& line, const ColumnRule& rule, int width, const std::string& text, Style style,
              bool unicode) {
  const std::string cut = cut_text(text, width, unicode);
  const int start = line.width();
  if (rule.right) line.pad_to(start + width - columns_of(cut));
  line.add(cut, style);
  line.pad_to(start + width + 1);
}

Style cell_style(const JobRow& row, Column column) {
  if (column == Column::state) return style_of(row.job);
  if (column == Column::trend) return row.job.state == JobState::running ? Style::active : Style::faint;
  return row.job.state == JobState::finished ? Style::faint : Style::plain;
}

bool is_sorted(Column column, SortBy by) {
  switch (by) {
    case SortBy::activity:
    case SortBy::state:
      return column == Column::state;
    case SortBy::age:
      return column == Column::job;
    case SortBy::client:
      return column == Column::client;
    case SortBy::problem:
      return column == Column::problem;
    case SortBy::size:
      return column == Column::size;
    case SortBy::priority:
      return column == Column::priority;
    case SortBy::iterations:
      return column == Column::iterations;
    case SortBy::time:
      return column == Column::time;
    case SortBy::violation:
      return column == Column::violation;
  }
  return false;
}

Line heading(const Widths& widths, const TableView& table, bool unicode) {
  const std::string down = unicode ? "▾" : "v", up = unicode ? "▴" : "^";
  Line line;
  for (std::size_t i = 0; i < kRules.size(); ++i) {
    if (widths[i] == 0) continue;
    const bool sorted = is_sorted(kRules[i].column, table.by);
    const std::string arrow = table.reversed ? up : down;
    std::string name = cut_text(kRules[i].name, widths[i] - (sorted ? 1 : 0), unicode);
    if (sorted) name += arrow;
    add_cell(line, kRules[i], widths[i], name, Style::strong, unicode);
  }
  return line;
}

Line row_line(const JobRow& row, const Widths& widths, bool unicode) {
  Line line;
  for (std::size_t i = 0; i < kRules.size(); ++i) {
    if (widths[i] == 0) continue;
    add_cell(line, kRules[i], widths[i], cell_text(row, kRules[i].column, widths[i], unicode),
             cell_style(row, kRules[i].column), unicode);
  }
  return line;
}

Line nothing(const Model& model, const View& view) {
  if (!view.table.filter.empty() && model.jobs.size() > 0)
    return {"no job matches the filter; Esc shows all", Style::faint};
  return {"no jobs yet", Style::faint};
}

}  // namespace

Lines table_lines(const Model& model, View& view, const Look& look, int height) {
  if (height < 1) return {};
  const Widths widths = widths_for(look.size.width);
  const auto rows = model.jobs.rows(view.table);
  const auto page = static_cast<std::size_t>(height - 1);
  const std::size_t selected = view.select(rows);
  view.scroll(page, rows.size());
  Lines lines{heading(widths, view.table, look.unicode)};
  if (rows.empty() && page > 0) lines.push_back(nothing(model, view));
  for (std::size_t i = view.top; i < std::min(rows.size(), view.top + page); ++i) {
    lines.push_back(row_line(*rows[i], widths, look.unicode));
    lines.back().selected = i == selected;
  }
  return lines;
}

}  // namespace marble::cli
