#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <clocale>
#include <filesystem>
#include <iostream>
#include <memory>

#include "base/atomic_file.h"
#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "output/convergence.h"
#include "output/trace_file.h"
#include "terminal/line.h"
#include "terminal/terminal_plot.h"

namespace marble::cli {
namespace {

struct PlotArguments {
  std::string trace;
  std::string output;
  bool terminal = false;
  std::vector<std::string> columns;  // empty: the default of the trace's kind
  std::string along;                 // likewise
};

const std::vector<std::string> kOfAPath = {
    "equality_violation", "inequality_violation", "complementarity_violation", "kkt_residual", "kappa",
    "objective"};
const std::vector<std::string> kOfATree = {"gap", "incumbent", "bound"};

using Columns = std::vector<const ProgressColumn*>;

constexpr Size kLeast = {40, 12};

int fails(const std::string& subject, const std::string& what) {
  complain(subject, what);
  return kBadInput;
}

Columns chosen(const std::vector<std::string>& names) {
  Columns columns;
  for (const std::string& name : names) {
    for (const ProgressColumn& column : progress_columns()) {
      if (column.name == name) columns.push_back(&column);
    }
  }
  return columns;
}

// The part of a trace to draw.
struct Drawing {
  std::vector<Progress> rows;
  const ProgressColumn& x;
  Columns columns;
};

Drawing drawing_of(const PlotArguments& arguments, std::vector<Progress> rows) {
  const bool tree = has_tree(rows);
  const std::string along = !arguments.along.empty() ? arguments.along : tree ? "elapsed_s" : "iteration";
  const auto& columns = !arguments.columns.empty() ? arguments.columns : tree ? kOfATree : kOfAPath;
  return {std::move(rows), *chosen({along}).front(), chosen(columns)};
}

Size terminal_size() {
  winsize window = {};
  const bool known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 0;
  const Size size = known ? Size{window.ws_col, window.ws_row - 1} : Size{80, 24};
  return {std::max(size.width, kLeast.width), std::max(size.height, kLeast.height)};
}

Lines panel(const Drawing& drawing, bool logarithmic, Size size, bool unicode) {
  const auto& [rows, along, columns] = drawing;
  std::vector<double> x;
  for (const Progress& row : rows) x.push_back(along.get(row));
  std::vector<Curve> curves;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (is_logarithmic(*columns[i]) == logarithmic)
      curves.push_back(curve_of(rows, *columns[i], static_cast<int>(i)));
  }
  return curves.empty() ? Lines()
                        : terminal_plot(x, curves, {size, logarithmic, unicode, std::string(along.name)});
}

const char* colour_of(Style style) {
  switch (style) {
    case Style::series_1:
      return "\033[36m";
    case Style::series_2:
      return "\033[33m";
    case Style::series_3:
      return "\033[35m";
    case Style::series_4:
      return "\033[32m";
    case Style::series_5:
      return "\033[34m";
    default:
      return "";
  }
}

std::string coloured(const Line& line, bool colours) {
  std::string text;
  for (const Span& span : line.spans()) {
    const char* colour = colours ? colour_of(span.style) : "";
    text += colour + span.text + (*colour != '\0' ? "\033[0m" : "");
  }
  return text.substr(0, text.find_last_not_of(' ') + 1);
}

bool colours_wanted_on_output() {
  const char* no_color = std::getenv("NO_COLOR");
  return isatty(STDOUT_FILENO) == 1 && (no_color == nullptr || *no_color == '\0');
}

int plot_here(const Drawing& drawing) {
  const bool unicode = set_terminal_locale();
  const Size size = terminal_size();
  const Columns& columns = drawing.columns;
  const auto logs = std::count_if(columns.begin(), columns.end(), [](auto* c) { return is_logarithmic(*c); });
  const bool both = logs > 0 && static_cast<std::size_t>(logs) < columns.size();
  const int upper = both ? size.height * 2 / 3 : size.height;
  const bool colours = colours_wanted_on_output();
  for (const bool logarithmic : {true, false}) {
    const int height = logarithmic || !both ? upper : size.height - upper;
    for (const Line& line : panel(drawing, logarithmic, {size.width, height}, unicode))
      std::cout << coloured(line, colours) << '\n';
  }
  return kAllSolved;
}

int plot_to_file(const PlotArguments& arguments, const Drawing& drawing) {
  const auto format = picture_format(arguments.output);
  if (!format) return fails(arguments.output, "must end in .png or .svg");
  auto file = AtomicFile::open(arguments.output);
  if (!file) return fails(file.error().field, file.error().bound);
  const std::string title = std::filesystem::path(arguments.trace).stem().string();
  const auto picture = run_gnuplot(trace_picture(drawing.rows, drawing.x, drawing.columns, *format, title));
  if (!picture) {
    if (picture.error().code != ErrorCode::not_found)
      return fails(arguments.output, picture.error().message());
    complain(arguments.output, "not written, gnuplot is not installed; here instead:");
    plot_here(drawing);
    return kBadInput;
  }
  file->write(*picture);
  if (auto written = file->commit(); !written) return fails(written.error().field, written.error().bound);
  return kAllSolved;
}

int run(const PlotArguments& arguments) {
  auto rows = read_trace(arguments.trace);
  if (!rows) return fails(arguments.trace, rows.error().message());
  const Drawing drawing = drawing_of(arguments, std::move(*rows));
  if (arguments.terminal || arguments.output.empty()) return plot_here(drawing);
  return plot_to_file(arguments, drawing);
}

}  // namespace

void add_plot(CLI::App& program, int& exit_code) {
  auto arguments = std::make_shared<PlotArguments>();
  CLI::App* command = program.add_subcommand(
      "plot",
      "Plot the convergence written by solve --trace or job --trace, as a picture or in the terminal");
  command->add_option("TRACE", arguments->trace, "CSV file; - is standard input")->required();
  CLI::Option* output = command->add_option("-o,--output", arguments->output,
                                            "write a picture to this file, .png or .svg; needs gnuplot");
  command->add_flag("--terminal", arguments->terminal, "plot in the terminal; the default without -o")
      ->excludes(output);
  std::vector<std::string> names;
  for (const ProgressColumn& column : progress_columns()) names.emplace_back(column.name);
  command
      ->add_option(
          "--columns", arguments->columns,
          "columns to plot, separated by commas. Violations, kkt_residual, kappa, rho, regularization and "
          "gap use a logarithmic axis, the others a linear one below; default: violations, kkt_residual, "
          "kappa and objective, or for a tree (option global_search) gap, incumbent and bound")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::IsMember(names));
  command
      ->add_option("--along", arguments->along,
                   "column of the horizontal axis; default: iteration, or elapsed_s for a tree")
      ->check(CLI::IsMember(names));
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace marble::cli
