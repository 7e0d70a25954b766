#include "base/gnuplot.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <iterator>
#include <string_view>

#include "base/atomic_file.h"
#include "base/program.h"

namespace marble::cli {
namespace {

constexpr std::array kColours = {"#1f6fb2", "#d1603d", "#3a9a5b", "#8a5fbf", "#b5892b", "#5b6770", "#c2427a"};

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

std::string gnuplot_style(PictureFormat format) {
  return std::string(format == PictureFormat::png
                         ? "set terminal pngcairo size 1200,900 font 'sans,11'\n"
                         : "set terminal svg size 1200,900 font 'sans,14' background 'white'\n") +
         "set border 3 linecolor rgb '#666666'\nset tics nomirror\n"
         "set grid linetype 1 linewidth 0.6 linecolor rgb '#e4e4e4'\n"
         "set key outside bottom center horizontal noenhanced\n";
}

std::string gnuplot_colour(std::size_t curve) {
  return std::string("rgb '") + kColours[curve % kColours.size()] + "'";
}

std::string gnuplot_number(double value) {
  char digits[32];
  const auto written = std::to_chars(std::begin(digits), std::end(digits), value);
  return std::isfinite(value) ? std::string(digits, written.ptr) : "NaN";
}

std::string gnuplot_text(const std::string& text) {
  std::string safe;
  for (const char c : text.substr(0, 100)) {
    const auto byte = static_cast<unsigned char>(c);
    safe += std::isalnum(byte) != 0 || (c != '\0' && std::strchr(" ._-+,:()", c) != nullptr) ? c : '_';
  }
  return safe;
}

Expected<std::string> run_gnuplot(const std::string& script) {
  MARBLE_ASSIGN_OR_RETURN(auto end, run_program({"gnuplot", "--default-settings"}, script));
  if (!end.well || end.out.empty())
    return unexpected(failure(ErrorCode::internal, "gnuplot", "failed: " + end.err));
  return std::move(end.out);
}

Expected<void> write_figure(const std::string& path, const std::string& csv,
                            const std::function<std::string(PictureFormat)>& script) {
  std::string content = csv;
  if (const auto format = picture_format(path)) {
    auto picture = run_gnuplot(script(*format));
    if (!picture) return unexpected(of_field(path, picture.error()));
    content = std::move(*picture);
  }
  MARBLE_ASSIGN_OR_RETURN(auto file, AtomicFile::open(path));
  file.write(content);
  return file.commit();
}

}  // namespace marble::cli
