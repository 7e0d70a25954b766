#include "trace/gnuplot.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>

#include "trace/convergence.h"

namespace marble::cli {
namespace {

constexpr double kMostDecades = 24.0;  // below that is rounding
constexpr std::array kColours = {"#1f6fb2", "#d1603d", "#3a9a5b", "#8a5fbf", "#b5892b", "#5b6770", "#c2427a"};

std::string number(double value) {
  char digits[32];
  const auto written = std::to_chars(std::begin(digits), std::end(digits), value);
  return std::isfinite(value) ? std::string(digits, written.ptr) : "NaN";
}

bool is_logarithmic_one(const ProgressColumn* column) { return is_logarithmic(*column); }

// Where exact zeros stand on a log axis: below everything else that is drawn.
struct Floor {
  double at = 0.0;
  bool used = false;
};

Floor floor_of(std::span<const Progress> rows, std::span<const ProgressColumn* const> columns) {
  double low = std::numeric_limits<double>::infinity(), high = 0.0;
  Floor floor;
  for (const ProgressColumn* column : columns) {
    if (!is_logarithmic(*column)) continue;
    for (const Progress& row : rows) {
      const double value = column->get(row);
      if (value == 0.0 && zero_counts(*column)) floor.used = true;
      if (!std::isfinite(value) || value <= 0.0) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  if (high == 0.0) low = high = 1.0;
  low = std::max(low, high * std::pow(10.0, -kMostDecades));
  floor.at = std::pow(10.0, std::floor(std::log10(low)) - 1.0);
  return floor;
}

std::string value_text(const Progress& row, const ProgressColumn& column, const Floor& floor) {
  const double value = column.get(row);
  if (!is_logarithmic(column) || value > floor.at) return number(value);
  if (value > 0.0) return number(floor.at);
  return value == 0.0 && zero_counts(column) ? number(floor.at) : "NaN";
}

// Column 1 is x, 2 is 1 where factorizations were repeated, then what is drawn.
std::string data_block(std::span<const Progress> rows, const ProgressColumn& x,
                       std::span<const ProgressColumn* const> columns, const Floor& floor) {
  std::string text = "$trace << END_OF_TRACE\n";
  for (std::size_t i = 0; i < rows.size(); ++i) {
    text += number(x.get(rows[i]));
    text += i > 0 && repeats_factorization(rows[i - 1], rows[i]) ? " 1" : " NaN";
    for (const ProgressColumn* column : columns) text += " " + value_text(rows[i], *column, floor);
    text += '\n';
  }
  return text + "END_OF_TRACE\n";
}

std::string safe_title(const std::string& title) {
  std::string safe;
  for (const char c : title.substr(0, 100)) {
    const auto byte = static_cast<unsigned char>(c);
    safe += std::isalnum(byte) != 0 || (c != '\0' && std::strchr(" ._-+,:()", c) != nullptr) ? c : '_';
  }
  return safe;
}

std::string panel(std::span<const ProgressColumn* const> columns, bool logarithmic, bool marks) {
  std::string curves;
  if (marks) {
    curves =
        "$trace using 1:2 axes x1y2 with impulses linewidth 1 linecolor rgb '#c8ccd0' "
        "title 'repeated factorization'";
  }
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (is_logarithmic(*columns[i]) != logarithmic) continue;
    if (!curves.empty()) curves += ", \\\n  ";
    curves += "$trace using 1:" + std::to_string(i + 3) + " with linespoints pointtype 7 pointsize 0.35 " +
              "linewidth 1.6 linecolor rgb '" + kColours[i % kColours.size()] + "' title '" +
              std::string(columns[i]->name) + "'";
  }
  return "plot " + curves + "\n";
}

// Decades, 12 of them at most, and 0 where it is drawn.
std::string log_axis(const Floor& floor) {
  std::string text = "set logscale y 10\nset format y '10^{%T}'\nset yrange [" + number(floor.at) + ":*]\n";
  if (floor.used) text += "set ytics add ('0' " + number(floor.at) + ")\n";
  return text;
}

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

std::string content_of(std::FILE* file) {
  std::rewind(file);
  std::string content;
  char chunk[16384];
  for (std::size_t count = 0; (count = std::fread(chunk, 1, sizeof chunk, file)) > 0;)
    content.append(chunk, count);
  return content;
}

Error internal(std::string what) { return failure(ErrorCode::internal, "gnuplot", std::move(what)); }

// Its exit status as waitpid has it, or minus errno.
int run_program(std::FILE* in, std::FILE* out, std::FILE* err) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, fileno(in), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(out), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, fileno(err), STDERR_FILENO);
  char name[] = "gnuplot", defaults[] = "--default-settings";
  char* const arguments[] = {name, defaults, nullptr};
  pid_t child = -1;
  const int fault = posix_spawnp(&child, name, &actions, nullptr, arguments, environ);
  posix_spawn_file_actions_destroy(&actions);
  if (fault != 0) return -fault;
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

}  // namespace

std::optional<PictureFormat> picture_format(const std::string& path) {
  const auto ends_in = [&path](std::string_view end) {
    return path.size() >= end.size() &&
           std::equal(end.begin(), end.end(), path.end() - static_cast<std::ptrdiff_t>(end.size()),
                      [](char a, char b) { return a == std::tolower(static_cast<unsigned char>(b)); });
  };
  if (ends_in(".png")) return PictureFormat::png;
  if (ends_in(".svg")) return PictureFormat::svg;
  return {};
}

std::string gnuplot_script(std::span<const Progress> rows, const ProgressColumn& x,
                           std::span<const ProgressColumn* const> columns, PictureFormat format,
                           const std::string& title) {
  const Floor floor = floor_of(rows, columns);
  const bool upper = std::any_of(columns.begin(), columns.end(), is_logarithmic_one);
  const bool lower = !std::all_of(columns.begin(), columns.end(), is_logarithmic_one);
  bool repeated = false;
  for (std::size_t i = 1; i < rows.size(); ++i) repeated |= repeats_factorization(rows[i - 1], rows[i]);
  std::string text = data_block(rows, x, columns, floor);
  text += format == PictureFormat::png ? "set terminal pngcairo size 1200,900 font 'sans,11'\n"
                                       : "set terminal svg size 1200,900 font 'sans,14' background 'white'\n";
  text +=
      "set border 3 linecolor rgb '#666666'\nset tics nomirror\nset grid linetype 1 linewidth 0.6 linecolor "
      "rgb '#e4e4e4'\n";
  text += "set key outside bottom center horizontal noenhanced\nset y2range [0:1]\nset lmargin 12\n";
  text += "set title '" + safe_title(title) + "' noenhanced\n";
  if (upper && lower) text += "set multiplot\nset size 1,0.64\nset origin 0,0.36\n";
  const std::string x_label = "set xlabel '" + std::string(x.name) + "' noenhanced\n";
  if (upper) text += log_axis(floor) + (lower ? "" : x_label) + panel(columns, true, repeated);
  if (upper && lower) text += "unset title\nset size 1,0.36\nset origin 0,0\n";
  if (lower) {
    text += "unset logscale y\nset format y '%g'\nset yrange [*:*]\nset ytics autofreq\n" + x_label;
    text += panel(columns, false, repeated && !upper);
  }
  return text + (upper && lower ? "unset multiplot\n" : "");
}

Expected<std::string> run_gnuplot(const std::string& script) {
  const File in(std::tmpfile()), out(std::tmpfile()), err(std::tmpfile());
  if (!in || !out || !err)
    return unexpected(internal(std::string("no temporary file: ") + std::strerror(errno)));
  std::fwrite(script.data(), 1, script.size(), in.get());
  std::rewind(in.get());
  const int status = run_program(in.get(), out.get(), err.get());
  if (status == -ENOENT) return unexpected(failure(ErrorCode::not_found, "gnuplot", "is not installed"));
  if (status < 0) return unexpected(internal(std::string("cannot be started: ") + std::strerror(-status)));
  std::string picture = content_of(out.get());
  if (status != 0 || picture.empty()) return unexpected(internal("failed: " + content_of(err.get())));
  return picture;
}

}  // namespace marble::cli
