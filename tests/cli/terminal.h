// Both ends of a terminal: the program has one, the test sits at the other.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <termios.h>
#include <unistd.h>

#include <cstdlib>
#include <stdexcept>
#include <string>

#include "support/child_process.h"

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

// What a terminal shows, as text: output goes in, the screen comes out. tests/cli/screen_of does the
// work, one process for the life of this.
class EmulatedScreen {
 public:
  EmulatedScreen(int width, int height)
      : requests_(pipe_at("requests")),
        answers_(pipe_at("answers")),
        emulator_(
            {"/bin/sh", "-c",
             std::string("exec '") + SCREEN_OF + "' " + std::to_string(width) + " " + std::to_string(height) +
                 " <'" + directory_.file("requests") + "' >'" + directory_.file("answers") + "'"},
            directory_.file("errors")) {}
  ~EmulatedScreen() {
    close(requests_);
    close(answers_);
  }
  EmulatedScreen(const EmulatedScreen&) = delete;
  EmulatedScreen& operator=(const EmulatedScreen&) = delete;

  void show(const std::string& output) {
    if (!output.empty()) ask("show " + std::to_string(output.size()) + "\n" + output);
  }
  void resize(int width, int height) {
    ask("size " + std::to_string(width) + " " + std::to_string(height) + "\n");
  }
  /// Its lines, blanks at their ends left out.
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  static constexpr int kLongest_ms = 60'000;

  // Open at both ends, so that neither side waits for the other to come.
  [[nodiscard]] int pipe_at(const std::string& name) const {
    const std::string path = directory_.file(name);
    const int end = mkfifo(path.c_str(), 0600) == 0 ? open(path.c_str(), O_RDWR | O_CLOEXEC) : -1;
    if (end < 0) throw std::runtime_error("no pipe to be had");
    return end;
  }
  void ask(const std::string& request) {
    for (std::size_t sent = 0; sent < request.size();) {
      const ssize_t count = write(requests_, request.data() + sent, request.size() - sent);
      if (count <= 0) throw std::runtime_error("screen_of takes nothing");
      sent += static_cast<std::size_t>(count);
    }
    std::string length;
    for (std::string byte = read(1); byte != "\n"; byte = read(1)) length += byte;
    text_ = read(std::stoul(length));
  }
  [[nodiscard]] std::string read(std::size_t size) const {
    std::string bytes(size, '\0');
    for (std::size_t have = 0; have < size;) {
      pollfd ready{answers_, POLLIN, 0};
      if (poll(&ready, 1, kLongest_ms) != 1)
        throw std::runtime_error("screen_of does not answer: " + emulator_.output());
      const ssize_t count = ::read(answers_, bytes.data() + have, size - have);
      if (count <= 0) throw std::runtime_error("screen_of has ended: " + emulator_.output());
      have += static_cast<std::size_t>(count);
    }
    return bytes;
  }

  TemporaryDirectory directory_;
  int requests_, answers_;
  ChildProcess emulator_;
  std::string text_;
};

}  // namespace marble::testing
