// Provides the user's choice of what is shown, and how keys change it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "terminal/screen.h"
#include "watch/model.h"

namespace marble::cli {

/// A key's request beyond a change of the view.
struct Request {
  enum class Kind { none, quit, open, close, cancel } kind = Kind::none;
  std::string job_id = {};
};

/// A prompt on the last line.
enum class Prompt { none, filter, confirm_cancel };

struct View {
  TableView table;
  std::string selected;       ///< job id; empty: the first row
  std::size_t index = 0;      ///< its last position: the row that replaces it is selected
  std::size_t top = 0;        ///< the first visible row
  std::string opened;         ///< job id; empty: the table
  bool began_opened = false;  ///< there is no table to go back to
  bool paused = false;
  bool help = false;
  Prompt prompt = Prompt::none;
  std::string asked_about;  ///< the job of confirm_cancel

  /// Processes a key. `rows` are those of the visible table, `page` how many fit. Returns the request.
  [[nodiscard]] Request press(const Key& key, const std::vector<const JobRow*>& rows, std::size_t page);

  /// Returns the index of the selected row, or of its replacement; 0 if there are none. Remembers it.
  std::size_t select(const std::vector<const JobRow*>& rows);
  /// Moves `top` so that the selected one of `rows` is among the `page` visible ones.
  void scroll(std::size_t page, std::size_t rows);

 private:
  [[nodiscard]] Request answer(const Key& key);
  [[nodiscard]] Request back();
  [[nodiscard]] Request letter(char letter);
  void move(const Key& key, const std::vector<const JobRow*>& rows, std::size_t page);
};

}  // namespace marble::cli
