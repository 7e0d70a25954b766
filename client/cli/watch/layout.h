// The live view as lines of text, from what is known and how large the terminal is. Knows no terminal.
#pragma once

#include <cstddef>

#include "terminal/line.h"
#include "watch/state/model.h"
#include "watch/view.h"

namespace marble::cli {

struct Look {
  Size size;
  bool unicode = true;
  double now_s = 0.0;  ///< of the clock that the model's times are by
};

/// How many rows of the table fit.
[[nodiscard]] std::size_t page_of(const Size& size);

/// The whole screen, exactly look.size.height lines of at most look.size.width columns. Selects and scrolls.
[[nodiscard]] Lines layout(const Model& model, View& view, const Look& look);

/// Its parts; each at most as many lines as it is told.
[[nodiscard]] Lines server_lines(const Model& model, const View& view, const Look& look);
[[nodiscard]] Lines table_lines(const Model& model, View& view, const Look& look, int height);
[[nodiscard]] Lines job_lines(const OpenedJob& opened, const Look& look, int height);
[[nodiscard]] Lines help_lines();

/// How a job's state and ending look.
[[nodiscard]] Style style_of(const JobInfo& job);

}  // namespace marble::cli
