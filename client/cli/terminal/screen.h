// The whole terminal: lines drawn on it, keys read from it, and all as it was when this ends.
#pragma once

#include <memory>
#include <vector>

#include "terminal/key.h"
#include "terminal/line.h"

namespace marble::cli {

class Screen {
 public:
  /// Null where the terminal cannot be drawn on: TERM is unknown or cannot place its cursor.
  [[nodiscard]] static std::unique_ptr<Screen> open();
  ~Screen();
  Screen(const Screen&) = delete;
  Screen& operator=(const Screen&) = delete;

  [[nodiscard]] bool unicode() const { return unicode_; }
  /// As it is now.
  [[nodiscard]] Size size();
  /// Sends what differs from what is there.
  void draw(const Lines& lines);
  /// All that have been pressed.
  [[nodiscard]] std::vector<Key> keys();

  /// Gives the terminal back for a while, as for a stopped process.
  void suspend();
  /// Takes it again; the next draw sends everything.
  void resume();

 private:
  explicit Screen(bool unicode);

  bool unicode_;
  bool colours_ = false;
};

}  // namespace marble::cli
