// Provides the whole terminal: draws lines, reads keys, and restores the terminal at the end.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "terminal/line.h"

namespace marble::cli {

// Describes a pressed key.
enum class KeyName { text, up, down, page_up, page_down, home, end, enter, escape, backspace };

struct Key {
  KeyName name = KeyName::text;
  std::string text = {};  ///< for KeyName::text: one character, UTF-8
};

class Screen {
 public:
  /// Returns null if the terminal cannot be drawn on: TERM is unknown or cannot place its cursor.
  [[nodiscard]] static std::unique_ptr<Screen> open();
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  [[nodiscard]] bool unicode() const { return unicode_; }
  /// Returns the current size.
  [[nodiscard]] Size size();
  /// Sends the differences to the displayed content.
  void draw(const Lines& lines);
  /// Returns all keys pressed so far.
  [[nodiscard]] std::vector<Key> keys();

  /// Gives the terminal back temporarily, as for a stopped process.
  void suspend();
  /// Takes it again; the next draw sends everything.
  void resume();

 private:
  explicit Screen(bool unicode);

  bool unicode_;
  bool colours_ = false;
};

}  // namespace marble::cli
