// What the person at the keyboard has chosen to see, and how keys change it.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "terminal/key.h"
#include "watch/state/job_table.h"

namespace marble::cli {

/// What a key asks for beyond another look.
struct Request {
  enum class Kind { none, quit, open, close, cancel } kind = Kind::none;
  std::string job_id = {};
};

/// A place for an answer on the last line.
enum class Prompt { none, filter, confirm_cancel };

struct View {
  TableView table;
  std::string selected;       ///< job id; empty: the first row
  std::size_t index = 0;      ///< where it was last: who takes its place if it goes
  std::size_t top = 0;        ///< the first row that is shown
  std::string opened;         ///< job id; empty: the table
  bool began_opened = false;  ///< there is no table to go back to
  bool paused = false;
  bool help = false;
  Prompt prompt = Prompt::none;
  std::string asked_about;  ///< the job that confirm_cancel is about

  /// `rows` are those of the table as it is shown, `page` how many fit. Returns what is to be done.
  [[nodiscard]] Request press(const Key& key, const std::vector<const JobRow*>& rows, std::size_t page);

  /// The selected row, or the one in its place; 0 if there are none. Remembers it.
  std::size_t select(const std::vector<const JobRow*>& rows);
  /// Moves `top` so that the selected one of `rows` is among the `page` that are shown.
  void scroll(std::size_t page, std::size_t rows);

 private:
  [[nodiscard]] Request answer(const Key& key);
  [[nodiscard]] Request back();
  [[nodiscard]] Request letter(char letter);
  void move(const Key& key, const std::vector<const JobRow*>& rows, std::size_t page);
};

}  // namespace marble::cli
