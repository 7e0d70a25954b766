#include "watch/view.h"

#include <algorithm>

namespace marble::cli {
namespace {

constexpr std::size_t kLongestFilter = 60;

void remove_last_character(std::string& text) {
  while (!text.empty()) {
    const auto byte = static_cast<unsigned char>(text.back());
    text.pop_back();
    if ((byte & 0xc0) != 0x80) return;
  }
}

}  // namespace

std::size_t View::select(const std::vector<const JobRow*>& rows) {
  if (rows.empty()) return 0;
  const auto found =
      std::find_if(rows.begin(), rows.end(), [&](const JobRow* row) { return row->job.job_id == selected; });
  if (found != rows.end()) {
    index = static_cast<std::size_t>(found - rows.begin());
  } else {
    index = selected.empty() ? 0 : std::min(index, rows.size() - 1);
    if (!selected.empty()) selected = rows[index]->job.job_id;
  }
  return index;
}

void View::scroll(std::size_t page, std::size_t rows) {
  top = std::min(top, rows > page ? rows - page : 0);
  if (index < top) top = index;
  if (page > 0 && index >= top + page) top = index - page + 1;
}

Request View::press(const Key& key, const std::vector<const JobRow*>& rows, std::size_t page) {
  if (prompt != Prompt::none) return answer(key);
  if (help) {
    help = false;
    return {};
  }
  select(rows);
  switch (key.name) {
    case KeyName::escape:
    case KeyName::backspace:
      if (opened.empty() && !table.filter.empty()) {
        table.filter.clear();
        return {};
      }
      return back();
    case KeyName::enter:
      if (!opened.empty() || rows.empty()) return {};
      opened = rows[index]->job.job_id;
      return {Request::Kind::open, opened};
    case KeyName::text:
      if (key.text.size() != 1) return {};
      asked_about = opened;
      if (opened.empty() && !rows.empty()) asked_about = rows[index]->job.job_id;
      return letter(key.text.front());
    default:
      if (opened.empty()) move(key, rows, page);
      return {};
  }
}

Request View::letter(char letter) {
  switch (letter) {
    case 'q':
      return back();
    case '?':
    case 'h':
      help = true;
      return {};
    case 'p':
    case ' ':
      paused = !paused;
      return {};
    case 'c':
      if (!asked_about.empty()) prompt = Prompt::confirm_cancel;
      return {};
    default:
      break;
  }
  if (!opened.empty()) return {};
  if (letter == 's') table.by = static_cast<SortBy>((static_cast<int>(table.by) + 1) % kSortBys);
  if (letter == 'r') table.reversed = !table.reversed;
  if (letter == '/') prompt = Prompt::filter;
  return {};
}

Request View::answer(const Key& key) {
  if (prompt == Prompt::confirm_cancel) {
    prompt = Prompt::none;
    const bool yes = key.name == KeyName::text && (key.text == "y" || key.text == "Y");
    return yes ? Request{Request::Kind::cancel, asked_about} : Request{};
  }
  switch (key.name) {
    case KeyName::enter:
      prompt = Prompt::none;
      break;
    case KeyName::escape:
      prompt = Prompt::none;
      table.filter.clear();
      break;
    case KeyName::backspace:
      remove_last_character(table.filter);
      break;
    case KeyName::text:
      if (table.filter.size() + key.text.size() <= kLongestFilter) table.filter += key.text;
      break;
    default:
      break;
  }
  return {};
}

Request View::back() {
  if (opened.empty() || began_opened) return {Request::Kind::quit};
  selected = opened;
  opened.clear();
  return {Request::Kind::close};
}

void View::move(const Key& key, const std::vector<const JobRow*>& rows, std::size_t page) {
  if (rows.empty()) return;
  const std::size_t last = rows.size() - 1;
  switch (key.name) {
    case KeyName::up:
      index -= index > 0 ? 1 : 0;
      break;
    case KeyName::down:
      index = std::min(index + 1, last);
      break;
    case KeyName::page_up:
      index -= std::min(index, page);
      break;
    case KeyName::page_down:
      index = std::min(index + page, last);
      break;
    case KeyName::home:
      index = 0;
      break;
    case KeyName::end:
      index = last;
      break;
    default:
      return;
  }
  selected = rows[index]->job.job_id;
}

}  // namespace marble::cli
