#include "problem_json.h"

#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <string>

#include "marble/convert.h"

namespace marble {
namespace {

constexpr std::size_t kPiece = 1 << 16;  // bytes written at once

class Writer {
 public:
  explicit Writer(const std::function<Expected<void>(std::string_view)>& report) : report_(report) {}

  void text(std::string_view text) {
    buffer_ += text;
    if (buffer_.size() >= kPiece) flush();
  }
  template <class Number>
  void number(Number value) {
    std::array<char, 40> digits;
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text({digits.data(), static_cast<std::size_t>(end - digits.data())});
  }
  // `get(k)` of all k < count.
  template <class Get>
  void array(std::size_t count, const Get& get) {
    text("[");
    for (std::size_t k = 0; k < count && reported_; ++k) {
      if (k > 0) text(",");
      number(get(k));
    }
    text("]");
  }
  void flush() {
    if (reported_) reported_ = report_(buffer_);
    buffer_.clear();
  }
  [[nodiscard]] const Expected<void>& reported() const { return reported_; }

 private:
  const std::function<Expected<void>(std::string_view)>& report_;
  std::string buffer_;
  Expected<void> reported_;
};

// Column and position of every entry that a matrix's column pointers lead to.
template <class Visit>
void each_entry(const SparseMatrixView& m, const Visit& visit) {
  const std::size_t entries = std::min(m.values.size(), m.row_indices.size());
  for (std::size_t column = 0; column + 1 < m.column_pointers.size(); ++column) {
    const Index begin = m.column_pointers[column], end = m.column_pointers[column + 1];
    for (Index k = std::max<Index>(begin, 0); k < end && static_cast<std::size_t>(k) < entries; ++k)
      visit(static_cast<Index>(column), static_cast<std::size_t>(k));
  }
}

// Of triplets one list; `mirror` adds the lower triangle.
template <class Get>
void triplets(Writer& writer, const char* key, const SparseMatrixView& m, bool mirror, const Get& get) {
  writer.text(key);
  bool first = true;
  const auto put = [&](Index row, Index column, double value) {
    if (!first) writer.text(",");
    first = false;
    writer.number(get(row, column, value));
  };
  each_entry(m, [&](Index column, std::size_t k) {
    put(m.row_indices[k], column, m.values[k]);
    if (mirror && m.row_indices[k] != column) put(column, m.row_indices[k], m.values[k]);
  });
  writer.text("]");
}

void matrix(Writer& writer, const char* key, const SparseMatrixView& m, std::size_t rows, std::size_t columns,
            bool mirror) {
  writer.text(std::string(",\"") + key + "\":{\"rows\":");
  writer.number(rows);
  writer.text(",\"cols\":");
  writer.number(columns);
  triplets(writer, ",\"i\":[", m, mirror, [](Index row, Index, double) { return row; });
  triplets(writer, ",\"j\":[", m, mirror, [](Index, Index column, double) { return column; });
  triplets(writer, ",\"v\":[", m, mirror, [](Index, Index, double value) { return value; });
  writer.text("}");
}

}  // namespace

bool has_problem(const v1::SolveRequest& request) { return request.problem().gradient_size() > 0; }

Expected<void> write_problem_json(const v1::SolveRequest& request,
                                  const std::function<Expected<void>(std::string_view)>& report) {
  const ProblemView p = view_of(request.problem());
  const std::size_t n = p.g.size();
  Writer writer(report);
  using Json = nlohmann::json;
  writer.text(
      "{\"name\":" + Json(request.problem().name()).dump(-1, ' ', false, Json::error_handler_t::replace) +
      ",\"n\":");
  writer.number(n);
  writer.text(",\"c0\":");
  writer.number(p.c0);
  const bool upper = p.hessian_form == HessianForm::upper_triangle;
#define MARBLE_VECTOR(letter, field)                 \
  writer.text(std::string(",\"") + #letter + "\":"); \
  writer.array(p.letter.size(), [&](std::size_t k) { return p.letter[k]; });
#define MARBLE_MATRIX(letter, field, update, vector) \
  matrix(writer, #letter, p.letter, p.vector.size(), n, upper&& std::string_view(#letter) == "Q");
#include "marble/contract.def"
  const auto& start = request.initial_point().z();
  writer.text(",\"x0\":");
  if (start.empty()) {
    writer.text("null");
  } else {
    writer.array(static_cast<std::size_t>(start.size()),
                 [&](std::size_t k) { return start[static_cast<int>(k)]; });
  }
  writer.text("}\n");
  writer.flush();
  return writer.reported();
}

}  // namespace marble
