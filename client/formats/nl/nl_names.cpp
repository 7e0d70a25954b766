#include "nl/nl_names.h"

#include <fstream>

namespace marble::formats {
namespace {

std::vector<std::string> lines_of(const std::string& path) {
  std::vector<std::string> lines;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.ends_with('\r')) line.pop_back();
    lines.push_back(std::move(line));
  }
  return lines;
}

std::string name(const std::vector<std::string>& names, int index, char kind) {
  const std::string number = kind + std::to_string(index);
  const auto at = static_cast<std::size_t>(index);
  return at < names.size() && !names[at].empty() ? names[at] + " (" + number + ")" : number;
}

}  // namespace

NlNames NlNames::beside(const std::string& stub) {
  return {lines_of(stub + ".row"), lines_of(stub + ".col")};
}

std::string NlNames::row(int index) const { return name(rows, index, 'C'); }

std::string NlNames::column(int index) const { return name(columns, index, 'v'); }

}  // namespace marble::formats
