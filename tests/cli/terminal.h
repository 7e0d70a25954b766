// Both ends of a terminal: the program has one, the test sits at the other.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace marble::testing {

class Terminal {
 public:
  explicit Terminal(int width = 80, int height = 24)
      : keyboard_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    if (keyboard_ < 0 || grantpt(keyboard_) != 0 || unlockpt(keyboard_) != 0)
      throw std::runtime_error("no terminal to be had");
    path_ = ptsname(keyboard_);
    screen_ = open(path_.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);  // keeps it alive when the program ends
    resize(width, height);
  }
  ~Terminal() {
    close(screen_);
    close(keyboard_);
  }
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

  void resize(int width, int height) {
    width_ = width;
    height_ = height;
    winsize size = {};
    size.ws_col = static_cast<unsigned short>(width);
    size.ws_row = static_cast<unsigned short>(height);
    ioctl(keyboard_, TIOCSWINSZ, &size);
  }
  void type(const std::string& keys) const {
    if (write(keyboard_, keys.data(), keys.size()) != static_cast<ssize_t>(keys.size()))
      throw std::runtime_error("the terminal takes no keys");
  }
  /// What was written since the last call.
  [[nodiscard]] std::string shown() const {
    std::string text;
    pollfd ready{keyboard_, POLLIN, 0};
    char chunk[4096];
    while (poll(&ready, 1, 0) == 1 && (ready.revents & POLLIN) != 0) {
      const auto count = read(keyboard_, chunk, sizeof chunk);
      if (count <= 0) break;
      text.append(chunk, static_cast<std::size_t>(count));
    }
    return text;
  }
  [[nodiscard]] termios settings() const {
    termios now = {};
    tcgetattr(screen_, &now);
    return now;
  }

 private:
  int keyboard_, screen_ = -1;
  int width_ = 0, height_ = 0;
  std::string path_;
};

}  // namespace marble::testing
