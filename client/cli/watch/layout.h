// Lays out the live view as lines of text, from the model and the terminal's size. Independent of any
// terminal.
#pragma once

#include <cstddef>

#include "terminal/line.h"
#include "watch/model.h"
#include "watch/view.h"

namespace marble::cli {

struct Look {
  Size size;
  bool unicode = true;
  double now_s = 0.0;  ///< on the clock of the model's times
};

/// Returns how many rows of the table fit.
[[nodiscard]] std::size_t page_of(const Size& size);

/// Returns the whole screen, exactly look.size.height lines of at most look.size.width columns. Selects and
/// scrolls.
[[nodiscard]] Lines layout(const Model& model, View& view, const Look& look);

/// Its parts; each has at most the given number of lines.
[[nodiscard]] Lines server_lines(const Model& model, const View& view, const Look& look);
[[nodiscard]] Lines table_lines(const Model& model, View& view, const Look& look, int height);
[[nodiscard]] Lines job_lines(const OpenedJob& opened, const Look& look, int height);
[[nodiscard]] Lines help_lines();

/// Returns the style of a job's state and result.
[[nodiscard]] Style style_of(const JobInfo& job);

}  // namespace marble::cli
