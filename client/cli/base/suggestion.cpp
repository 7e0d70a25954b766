#include "base/suggestion.h"

#include <algorithm>
#include <utility>

namespace marble::cli {
namespace {

constexpr std::size_t kMostNames = 3, kLongestWord = 64;
constexpr double kSimilar = 0.7, kNearlyAsSimilar = 0.1;

// Returns the length of the longest common subsequence.
std::size_t common_length(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1, 0);
  for (const char letter : a) {
    std::size_t diagonal = 0;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t above = row[j + 1];
      row[j + 1] = letter == b[j] ? diagonal + 1 : std::max(above, row[j]);
      diagonal = above;
    }
  }
  return row[b.size()];
}

// Returns 1 for equal names and 0 for names without a common letter.
double similarity(std::string_view a, std::string_view b) {
  const std::size_t letters = a.size() + b.size();
  return letters == 0 ? 0.0 : 2.0 * static_cast<double>(common_length(a, b)) / static_cast<double>(letters);
}

}  // namespace

std::vector<std::string> similar_names(std::string_view given, const std::vector<std::string>& known) {
  if (given.size() > kLongestWord) return {};
  std::vector<std::pair<double, std::string>> found;
  for (const std::string& name : known) {
    const double similar = similarity(given, name);
    if (similar >= kSimilar) found.emplace_back(similar, name);
  }
  std::ranges::stable_sort(found, [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::string> names;
  for (const auto& [similar, name] : found) {
    if (names.size() < kMostNames && similar >= found.front().first - kNearlyAsSimilar) names.push_back(name);
  }
  return names;
}

std::string did_you_mean(std::string_view given, const std::vector<std::string>& known) {
  std::string text;
  for (const std::string& name : similar_names(given, known))
    text += (text.empty() ? "; did you mean " : " or ") + name;
  return text.empty() ? text : text + "?";
}

}  // namespace marble::cli
