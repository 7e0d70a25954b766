// Pictures of a trace by gnuplot, where it is installed.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "marble/error.h"
#include "marble/progress.h"
#include "marble/progress_csv.h"

namespace marble::cli {

enum class PictureFormat { png, svg };

/// By the end of the file's name, .png or .svg; none if it is another.
[[nodiscard]] std::optional<PictureFormat> picture_format(const std::string& path);

/// gnuplot's commands, data included, that write the picture to standard output: logarithmic columns on one
/// panel, the others on one below, along x, and where factorizations were repeated. Of `title` letters,
/// digits and simple punctuation are kept.
[[nodiscard]] std::string gnuplot_script(std::span<const Progress> rows, const ProgressColumn& x,
                                         std::span<const ProgressColumn* const> columns, PictureFormat format,
                                         const std::string& title);

/// Runs gnuplot, without a shell and without the user's settings; the picture's bytes. Errors: not_found if
/// gnuplot is not installed, internal with its own words if it failed.
[[nodiscard]] Expected<std::string> run_gnuplot(const std::string& script);

}  // namespace marble::cli
