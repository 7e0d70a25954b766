// Lays out one job: its facts, its convergence as curves, its newest rows.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "output/convergence.h"
#include "output/job_report.h"
#include "output/proof.h"
#include "terminal/terminal_plot.h"
#include "watch/layout.h"

namespace marble::cli {
namespace {

constexpr int kRoomyJobHeight = 18;
constexpr int kBetweenFacts = 3;  // columns
constexpr int kLeastPlot = 6, kMostPlot = 24;

Line fact(const char* name, const std::string& text, Style style = Style::plain) {
  Line line(std::string(name) + " ", Style::faint);
  line.add(text, style);
  return line;
}

// Places facts side by side, on as many lines as needed, but at most `most`.
Lines flowed(const std::vector<Line>& facts, int width, std::size_t most) {
  Lines lines(1);
  for (const Line& fact : facts) {
    const int start = lines.back().width() > 0 ? lines.back().width() + kBetweenFacts : 0;
    if (start > 0 && start + fact.width() > width && lines.size() < most) {
      lines.push_back(fact);
      continue;
    }
    lines.back().pad_to(start);
    for (const Span& span : fact.spans()) lines.back().add(span.text, span.style);
  }
  return lines;
}

std::string state_text(const JobInfo& job) {
  if (job.state == JobState::finished) return ending(job);
  std::string text = to_string(job.state);
  if (job.state != JobState::queued) return text;
  text += " behind " + std::to_string(job.queue_position);
  return job.estimated_wait_s > 0.0 ? text + ", about " + duration_text(job.estimated_wait_s) : text;
}

std::vector<Line> job_facts(const OpenedJob& opened, bool unicode) {
  const JobInfo& job = opened.job;
  Line identity = fact("job", job.job_id, Style::strong);
  identity.add("  " + state_text(job), style_of(job));
  if (opened.gone) identity.add("  not known to the server any more", Style::bad);
  return {std::move(identity), fact("problem", shown_text(job.problem_name, unicode))};
}

std::vector<Line> origin_facts(const JobInfo& job, bool unicode) {
  std::vector<Line> facts = {fact("n/n_e/n_i/n_c", sizes_text(job)),
                             fact("priority", to_string(job.priority)),
                             fact("client", shown_text(job.client, unicode))};
  if (!job.request_id.empty()) facts.push_back(fact("request", shown_text(job.request_id, unicode)));
  if (job.kind == JobKind::array)
    facts.push_back(
        fact("elements", std::to_string(job.array.done) + " of " + std::to_string(job.array.elements)));
  if (job.kind == JobKind::session) facts.push_back(fact("updates", std::to_string(job.updates)));
  if (job.activity) facts.push_back(fact("now", describe(*job.activity), Style::active));
  return facts;
}

std::vector<Line> work_facts(const JobInfo& job) {
  return {fact("iterations", std::to_string(job.iterations)),
          fact("factorizations", std::to_string(job.factorizations)),
          fact("objective", formatted("%.8g", job.objective)),
          fact("violation", formatted("%.1e", largest(job.violations)))};
}

std::vector<Line> tree_facts(const OpenedJob& opened) {
  const JobInfo& job = opened.job;
  if (job.nodes == 0) return {};
  const auto known = [](double value) {
    return std::isfinite(value) ? formatted("%.8g", value) : "none yet";
  };
  std::vector<Line> facts = {fact("incumbent", known(job.incumbent)), fact("bound", known(job.bound)),
                             fact("gap", std::isfinite(job.gap) ? formatted("%.1e", job.gap) : "-"),
                             fact("nodes", whole_text(job.nodes)), fact("open", whole_text(job.open_nodes))};
  if (const auto speed = nodes_per_s(opened.trace.values()))
    facts.push_back(fact("nodes/s", formatted("%.0f", *speed)));
  if (job.proved) facts.push_back(fact("", proof_text(proof_of(job)), Style::good));
  return facts;
}

std::vector<Line> time_facts(const JobInfo& job) {
  std::vector<Line> facts = {fact("time", duration_text(job.total_s)),
                             fact("queue", duration_text(job.queue_s))};
  if (job.times.solve_s <= 0.0) return facts;  // known with the solution
  facts.push_back(fact("set-up", duration_text(job.times.setup_s)));
  facts.push_back(fact("solve", duration_text(job.times.solve_s)));
  facts.push_back(fact("of it factorizations", duration_text(job.times.factorization_s)));
  facts.push_back(fact("line search", duration_text(job.times.line_search_s)));
  facts.push_back(fact("polish", duration_text(job.times.polish_s)));
  if (job.times.tree_s > 0.0) facts.push_back(fact("tree", duration_text(job.times.tree_s)));
  return facts;
}

Lines why_lines(const JobInfo& job, const Look& look) {
  if (job.state != JobState::finished) return {};
  const std::string why = job.error ? job.error->message() : job.detail;
  const std::size_t most = look.size.height >= kRoomyJobHeight ? 3 : 1;
  return wrapped(shown_text(why, look.unicode), look.size.width, most, style_of(job));
}

struct RowColumn {
  const char* name;
  int width;
  int importance;  // the least important is dropped first if space is short
  std::string (*text)(const Progress& row);
};

// In display order.
constexpr std::array<RowColumn, 10> kRowColumns = {{
    {"iter", 6, 9, [](const Progress& p) { return std::to_string(p.iteration); }},
    {"objective", 14, 7, [](const Progress& p) { return formatted("%.7e", p.objective); }},
    {"equality", 9, 4, [](const Progress& p) { return formatted("%.2e", p.violations.equality); }},
    {"inequal.", 9, 5, [](const Progress& p) { return formatted("%.2e", p.violations.inequality); }},
    {"complem.", 9, 8, [](const Progress& p) { return formatted("%.2e", p.violations.complementarity); }},
    {"residual", 9, 6, [](const Progress& p) { return formatted("%.2e", p.kkt_residual); }},
    {"kappa", 9, 3, [](const Progress& p) { return formatted("%.2e", p.kappa); }},
    {"step", 7, 1, [](const Progress& p) { return formatted("%.4f", p.step_length); }},
    {"regular.", 8, 0, [](const Progress& p) { return formatted("%.1e", p.regularization); }},
    {"fact", 5, 2, [](const Progress& p) { return std::to_string(p.factorizations); }},
}};

// The same for a tree.
constexpr std::array<RowColumn, 6> kTreeColumns = {{
    {"nodes", 9, 4, [](const Progress& p) { return std::to_string(p.nodes); }},
    {"open", 8, 1, [](const Progress& p) { return std::to_string(p.open_nodes); }},
    {"incumbent", 14, 3, [](const Progress& p) { return formatted("%.7e", p.incumbent); }},
    {"bound", 14, 5, [](const Progress& p) { return formatted("%.7e", p.bound); }},
    {"gap", 9, 2, [](const Progress& p) { return formatted("%.2e", p.gap); }},
    {"time", 9, 0, [](const Progress& p) { return duration_text(p.elapsed_s); }},
}};

// Returns the columns that fit.
std::vector<RowColumn> row_columns(std::span<const RowColumn> all, int width) {
  std::vector<RowColumn> columns(all.begin(), all.end());
  const auto needed = [&] {
    int sum = -1;  // a blank between two
    for (const RowColumn& column : columns) sum += column.width + 1;
    return sum;
  };
  while (columns.size() > 1 && needed() > width) {
    columns.erase(std::min_element(columns.begin(), columns.end(), [](const auto& left, const auto& right) {
      return left.importance < right.importance;
    }));
  }
  return columns;
}

Line row_line(const std::vector<RowColumn>& columns, const Progress* row, Style style) {
  std::string text;
  for (const RowColumn& column : columns) {
    const std::string cell = row != nullptr ? column.text(*row) : column.name;
    if (!text.empty()) text += ' ';
    text.append(static_cast<std::size_t>(std::max(0, column.width - static_cast<int>(cell.size()))), ' ');
    text += cell;
  }
  return {text, style};
}

Lines newest_rows(const OpenedJob& opened, const Look& look, int height) {
  if (height < 2 || opened.newest.empty()) return {};
  const std::size_t count = std::min(opened.newest.size(), static_cast<std::size_t>(height - 1));
  const bool tree = opened.newest.back().nodes > 0;
  const auto columns =
      tree ? row_columns(kTreeColumns, look.size.width) : row_columns(kRowColumns, look.size.width);
  Lines lines{row_line(columns, nullptr, Style::strong)};
  for (std::size_t i = opened.newest.size() - count; i < opened.newest.size(); ++i) {
    const bool troubled = i > 0 && repeats_factorization(opened.newest[i - 1], opened.newest[i]);
    lines.push_back(row_line(columns, &opened.newest[i], troubled ? Style::caution : Style::plain));
  }
  return lines;
}

Lines plot(const OpenedJob& opened, const Look& look, int height) {
  std::vector<double> x;
  std::vector<Progress> rows;
  for (const Progress& row : opened.trace.values()) {
    if (row.nodes == 0) continue;
    rows.push_back(row);
    x.push_back(row.elapsed_s);
  }
  if (!rows.empty()) {  // a small problem's tree has none
    return terminal_plot(x, proof_summary(rows), {{look.size.width, height}, false, look.unicode, "seconds"});
  }
  for (const Progress& row : opened.trace.values()) x.push_back(row.iteration);
  return terminal_plot(x, convergence_summary(opened.trace.values()),
                       {{look.size.width, height}, true, look.unicode});
}

}  // namespace

Lines job_lines(const OpenedJob& opened, const Look& look, int height) {
  const JobInfo& job = opened.job;
  const int width = look.size.width;
  const bool roomy = look.size.height >= kRoomyJobHeight;
  const std::size_t most = roomy ? 2 : 1;
  Lines lines = flowed(job_facts(opened, look.unicode), width, 1);
  if (roomy) append(lines, flowed(origin_facts(job, look.unicode), width, most));
  append(lines, flowed(work_facts(job), width, most));
  if (job.nodes > 0) append(lines, flowed(tree_facts(opened), width, most));
  append(lines, flowed(time_facts(job), width, most));
  append(lines, why_lines(job, look));
  const int left = height - static_cast<int>(lines.size());
  // The plot takes what it needs, the table the rest.
  const int plot_height = left <= kLeastPlot + 3 ? left : std::clamp(left * 3 / 5, kLeastPlot, kMostPlot);
  append(lines, plot(opened, look, plot_height));
  append(lines, newest_rows(opened, look, height - static_cast<int>(lines.size())));
  return lines;
}

}  // namespace marble::cli
