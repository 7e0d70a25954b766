#include "terminal/screen.h"

#define NCURSES_NOMACROS 1
#define NCURSES_WIDECHAR 1
#include <curses.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <climits>
#include <cstdint>
#include <cstdlib>
#include <optional>

#include "terminal/line.h"

namespace marble::cli {
namespace {

constexpr int kEscape_ms = 25;  // anything later than this after Esc is not part of a key
constexpr int kEscapeCode = 27, kDelete = 127, kBackspace = 8;

// The look of a style: one of the terminal's eight colours, and attributes that show the same without
// colours.
struct Look {
  short colour;
  attr_t attributes;
};
constexpr short kNone = -1;
constexpr std::array<Look, kStyles> kLooks = {{{kNone, A_NORMAL},
                                               {kNone, A_BOLD},
                                               {kNone, A_DIM},
                                               {COLOR_GREEN, A_NORMAL},
                                               {COLOR_RED, A_BOLD},
                                               {COLOR_YELLOW, A_NORMAL},
                                               {COLOR_CYAN, A_BOLD},
                                               {COLOR_CYAN, A_NORMAL},
                                               {COLOR_YELLOW, A_NORMAL},
                                               {COLOR_MAGENTA, A_NORMAL},
                                               {COLOR_GREEN, A_NORMAL},
                                               {COLOR_BLUE, A_NORMAL}}};

bool colours_allowed() {
  const char* no_color = std::getenv("NO_COLOR");
  return no_color == nullptr || *no_color == '\0';
}

attr_t attributes_of(Style style, bool colours) {
  const auto number = static_cast<std::size_t>(style);
  const Look& look = kLooks[number];
  const bool coloured = colours && look.colour != kNone;
  return look.attributes | (coloured ? static_cast<attr_t>(COLOR_PAIR(static_cast<int>(number) + 1)) : 0);
}

std::string utf8(wint_t code) {
  std::array<char, MB_LEN_MAX> bytes;
  const int count = std::wctomb(bytes.data(), static_cast<wchar_t>(code));
  return count > 0 ? std::string(bytes.data(), static_cast<std::size_t>(count)) : "";
}

std::optional<Key> special_key(wint_t code) {
  switch (code) {
    case KEY_UP:
      return Key{KeyName::up};
    case KEY_DOWN:
      return Key{KeyName::down};
    case KEY_PPAGE:
      return Key{KeyName::page_up};
    case KEY_NPAGE:
      return Key{KeyName::page_down};
    case KEY_HOME:
      return Key{KeyName::home};
    case KEY_END:
      return Key{KeyName::end};
    case KEY_ENTER:
      return Key{KeyName::enter};
    case KEY_BACKSPACE:
      return Key{KeyName::backspace};
    default:
      return {};
  }
}

std::optional<Key> plain_key(wint_t code) {
  if (code == '\n' || code == '\r') return Key{KeyName::enter};
  if (code == kEscapeCode) return Key{KeyName::escape};
  if (code == kDelete || code == kBackspace) return Key{KeyName::backspace};
  std::string text = utf8(code);
  if (code < ' ' || text.empty()) return {};
  return Key{KeyName::text, std::move(text)};
}

}  // namespace

std::unique_ptr<Screen> Screen::open() {
  const bool unicode = set_terminal_locale();
  use_env(TRUE);
  use_tioctl(TRUE);  // uses the terminal's real size before LINES and COLUMNS
  if (newterm(nullptr, stdout, stdin) == nullptr) return nullptr;
  char capability[] = "cup";  // the terminal can place its cursor
  const char* found = tigetstr(capability);
  if (found == nullptr || reinterpret_cast<std::intptr_t>(found) == -1) {
    endwin();
    return nullptr;
  }
  return std::unique_ptr<Screen>(new Screen(unicode));
}

Screen::Screen(bool unicode) : unicode_(unicode) {
  set_escdelay(kEscape_ms);
  cbreak();
  noecho();
  nonl();
  keypad(stdscr, TRUE);
  nodelay(stdscr, TRUE);
  leaveok(stdscr, TRUE);
  curs_set(0);
  colours_ = colours_allowed() && has_colors();
  if (!colours_) return;
  start_color();
  use_default_colors();
  for (int i = 0; i < kStyles; ++i)
    init_pair(static_cast<short>(i + 1), kLooks[static_cast<std::size_t>(i)].colour, kNone);
}

Screen::~Screen() { endwin(); }

Size Screen::size() {
  winsize window = {};
  const bool known = ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 0 && window.ws_row > 0;
  if (known && (window.ws_row != getmaxy(stdscr) || window.ws_col != getmaxx(stdscr))) {
    resizeterm(window.ws_row, window.ws_col);
    clearok(stdscr, TRUE);
  }
  return {getmaxx(stdscr), getmaxy(stdscr)};
}

void Screen::draw(const Lines& lines) {
  werase(stdscr);
  for (std::size_t row = 0; row < lines.size(); ++row) {
    const Line& line = lines[row];
    const attr_t base = line.selected ? A_REVERSE : A_NORMAL;
    wmove(stdscr, static_cast<int>(row), 0);
    for (const Span& span : line.spans()) {
      wattrset(stdscr, static_cast<int>(attributes_of(span.style, colours_) | base));
      waddnstr(stdscr, span.text.data(), static_cast<int>(span.text.size()));
    }
    wattrset(stdscr, static_cast<int>(base));
    for (int column = line.width(); line.selected && column < getmaxx(stdscr); ++column) waddch(stdscr, ' ');
  }
  wattrset(stdscr, A_NORMAL);
  wrefresh(stdscr);
}

std::vector<Key> Screen::keys() {
  std::vector<Key> keys;
  for (;;) {
    wint_t code = 0;
    const int kind = wget_wch(stdscr, &code);
    if (kind == ERR) break;
    const auto key = kind == KEY_CODE_YES ? special_key(code) : plain_key(code);
    if (key) keys.push_back(*key);
  }
  return keys;
}

void Screen::suspend() {
  def_prog_mode();
  endwin();
}

void Screen::resume() {
  reset_prog_mode();
  clearok(stdscr, TRUE);
  wrefresh(stdscr);
}

}  // namespace marble::cli
