// Pictures by gnuplot, where it is installed.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "marble/error.h"

namespace marble::cli {

enum class PictureFormat { png, svg };

/// By the end of the file's name, .png or .svg; none if it is another.
[[nodiscard]] std::optional<PictureFormat> picture_format(const std::string& path);

/// gnuplot's commands that choose the format, and how all pictures look.
[[nodiscard]] std::string gnuplot_style(PictureFormat format);

/// The colour of the curve with that number, as gnuplot takes it; after some they begin again.
[[nodiscard]] std::string gnuplot_colour(std::size_t curve);

/// A number as gnuplot reads it.
[[nodiscard]] std::string gnuplot_number(double value);

/// Text between single quotes: letters, digits and simple punctuation are kept.
[[nodiscard]] std::string gnuplot_text(const std::string& text);

/// Runs gnuplot, without a shell and without the user's settings; the picture's bytes. Errors: not_found if
/// gnuplot is not installed, internal with its own words if it failed.
[[nodiscard]] Expected<std::string> run_gnuplot(const std::string& script);

/// Writes a picture as the file's name ends, .png or .svg; else CSV. The error's field is the file.
[[nodiscard]] Expected<void> write_figure(const std::string& path, const std::string& csv,
                                          const std::function<std::string(PictureFormat)>& script);

}  // namespace marble::cli
