#include <array>
#include <charconv>

#include "marble/progress.h"

namespace marble {
namespace {

#define MARBLE_COLUMN(name, member, integer)                                                       \
  ProgressColumn {                                                                                 \
    name, integer, [](const Progress& row) { return static_cast<double>(row.member); },            \
        [](Progress& row, double value) { row.member = static_cast<decltype(row.member)>(value); } \
  }

constexpr std::array kColumns = {
    MARBLE_COLUMN("iteration", iteration, true),
    MARBLE_COLUMN("outer_iteration", outer_iteration, true),
    MARBLE_COLUMN("objective", objective, false),
    MARBLE_COLUMN("equality_violation", violations.equality, false),
    MARBLE_COLUMN("inequality_violation", violations.inequality, false),
    MARBLE_COLUMN("complementarity_violation", violations.complementarity, false),
    MARBLE_COLUMN("kkt_residual", kkt_residual, false),
    MARBLE_COLUMN("kappa", kappa, false),
    MARBLE_COLUMN("rho", rho, false),
    MARBLE_COLUMN("step_length", step_length, false),
    MARBLE_COLUMN("regularization", regularization, false),
    MARBLE_COLUMN("factorizations", factorizations, true),
    MARBLE_COLUMN("elapsed_s", elapsed_s, false),
    MARBLE_COLUMN("incumbent", incumbent, false),
    MARBLE_COLUMN("bound", bound, false),
    MARBLE_COLUMN("gap", gap, false),
    MARBLE_COLUMN("nodes", nodes, true),
    MARBLE_COLUMN("open_nodes", open_nodes, true),
};
static_assert(kColumns[kColumnsBeforeTrees - 1].name == "elapsed_s");

#undef MARBLE_COLUMN

void append_number(double value, bool integer, std::string& text) {
  std::array<char, 32> digits;
  char* const end = digits.data() + digits.size();
  const auto written = integer ? std::to_chars(digits.data(), end, static_cast<long long>(value))
                               : std::to_chars(digits.data(), end, value);
  text.append(digits.data(), written.ptr);
}

}  // namespace

std::span<const ProgressColumn> progress_columns() { return kColumns; }

std::string progress_csv_header() {
  std::string header;
  for (const ProgressColumn& column : kColumns) {
    if (!header.empty()) header += ',';
    header += column.name;
  }
  return header;
}

void append_progress_csv(const Progress& row, std::string& text) {
  bool first = true;
  for (const ProgressColumn& column : kColumns) {
    if (!first) text += ',';
    first = false;
    append_number(column.get(row), column.integer, text);
  }
}

}  // namespace marble
