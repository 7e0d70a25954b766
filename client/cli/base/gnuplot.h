// Draws pictures with gnuplot, if it is installed.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "marble/error.h"

namespace marble::cli {

enum class PictureFormat { png, svg };

/// Returns the format of the file's extension, .png or .svg; nothing for others.
[[nodiscard]] std::optional<PictureFormat> picture_format(const std::string& path);

/// Returns gnuplot's commands for the format and the common style of all pictures.
[[nodiscard]] std::string gnuplot_style(PictureFormat format);

/// Returns the colour of a curve in gnuplot's syntax; colours repeat after some curves.
[[nodiscard]] std::string gnuplot_colour(std::size_t curve);

/// Returns a number in gnuplot's syntax.
[[nodiscard]] std::string gnuplot_number(double value);

/// Returns text for single quotes: letters, digits and simple punctuation are kept.
[[nodiscard]] std::string gnuplot_text(const std::string& text);

/// Runs gnuplot without a shell and without the user's settings, and returns the picture's bytes. Errors:
/// not_found if gnuplot is not installed, internal with its own message if it failed.
[[nodiscard]] Expected<std::string> run_gnuplot(const std::string& script);

/// Writes a picture if the file's extension is .png or .svg, else CSV. The error's field is the file.
[[nodiscard]] Expected<void> write_figure(const std::string& path, const std::string& csv,
                                          const std::function<std::string(PictureFormat)>& script);

}  // namespace marble::cli
