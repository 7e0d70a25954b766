#include "output/conflict_text.h"

#include <algorithm>
#include <cmath>

#include "output/text_table.h"

namespace marble::cli {
namespace {

constexpr std::size_t kMostTerms = 8, kMostLines = 100;
constexpr std::size_t kLongestName = 40;

std::string number(double value) { return formatted("%.6g", value + 0.0); }

struct Term {
  Index column;
  double value;
};

std::vector<Term> row_of(const SparseMatrix& m, Index row) {
  std::vector<Term> terms;
  for (Index j = 0; j < m.columns && !m.values.empty(); ++j) {
    const auto begin = m.row_indices.begin() + m.column_pointers[static_cast<std::size_t>(j)];
    const auto end = m.row_indices.begin() + m.column_pointers[static_cast<std::size_t>(j) + 1];
    const auto found = std::lower_bound(begin, end, row);
    if (found == end || *found != row) continue;
    terms.push_back({j, m.values[static_cast<std::size_t>(found - m.row_indices.begin())]});
  }
  return terms;
}

class Writer {
 public:
  explicit Writer(const ProblemNames& names) : names_(names) {}

  [[nodiscard]] std::string variable(Index j) const {
    return named(names_.variables, j, "z[" + std::to_string(j) + "]");
  }
  [[nodiscard]] static std::string named(const std::vector<std::string>& names, Index index,
                                         std::string otherwise) {
    const auto at = static_cast<std::size_t>(index);
    return at < names.size() && !names[at].empty() ? terminal_text(names[at], kLongestName)
                                                   : std::move(otherwise);
  }
  // "x + 2 y >= 4" for x + 2 y − 4 ≥ 0, and "x <= 4" for 4 − x ≥ 0.
  [[nodiscard]] std::string row(const SparseMatrix& m, const std::vector<double>& offsets, Index row,
                                bool equality) const {
    const std::vector<Term> terms = row_of(m, row);
    const double sign = !terms.empty() && terms.front().value < 0.0 ? -1.0 : 1.0;
    const char* const relation = equality ? " = " : sign > 0.0 ? " >= " : " <= ";
    return sum(terms, sign) + relation + number(-sign * offsets[static_cast<std::size_t>(row)]);
  }

 private:
  [[nodiscard]] std::string sum(const std::vector<Term>& terms, double sign) const {
    if (terms.empty()) return "0";
    std::string text;
    for (std::size_t k = 0; k < std::min(terms.size(), kMostTerms); ++k) {
      const double value = sign * terms[k].value;
      text += k == 0 ? (value < 0.0 ? "-" : "") : (value < 0.0 ? " - " : " + ");
      if (std::abs(value) != 1.0) text += number(std::abs(value)) + " ";
      text += variable(terms[k].column);
    }
    if (terms.size() > kMostTerms) text += " + ... (" + std::to_string(terms.size()) + " terms)";
    return text;
  }

  const ProblemNames& names_;
};

}  // namespace

std::vector<ConflictLine> conflict_lines(const OwnedProblem& p, const ProblemNames& names,
                                         const Conflict& conflict, std::span<const double> certificate) {
  const Writer writer(names);
  const std::size_t rows = p.b.size() + p.d.size() + 2 * p.l.size();
  const bool known = conflict.complementarities.empty() && certificate.size() == rows;
  std::vector<ConflictLine> lines;
  std::size_t kind = 0;
  const auto add = [&](const std::vector<std::string>& of, const std::string& letter, const auto& text,
                       std::size_t first) {
    const auto& [name, several, indices] = kConflictKinds[kind++];
    for (const Index index : conflict.*indices) {
      lines.push_back(
          {name, index, Writer::named(of, index, letter + "[" + std::to_string(index) + "]"), text(index)});
      if (!known) continue;
      const double multiplier = std::abs(certificate[first + static_cast<std::size_t>(index)]);
      if (multiplier > 0.0) lines.back().relax = 1.0 / multiplier;
    }
  };
  add(
      names.equalities, "A", [&](Index row) { return writer.row(p.A, p.b, row, true); }, 0);
  add(
      names.inequalities, "C", [&](Index row) { return writer.row(p.C, p.d, row, false); }, p.b.size());
  add(
      names.pairs, "pair", [&](Index pair) { return writer.row(p.L, p.l, pair, false); },
      p.b.size() + p.d.size());
  add(
      names.pairs, "pair", [&](Index pair) { return writer.row(p.R, p.r, pair, false); },
      p.b.size() + p.d.size() + p.l.size());
  add(
      names.pairs, "pair",
      [&](Index pair) {
        return writer.row(p.L, p.l, pair, true) + "  or  " + writer.row(p.R, p.r, pair, true);
      },
      0);
  return lines;
}

std::string conflict_text(const Conflict& conflict, const std::vector<ConflictLine>& lines) {
  const bool one = lines.size() == 1;
  std::string text = "  conflict        ";
  text += one ? "no point meets this part, whatever the others are:\n"
              : "no point meets these " + std::to_string(lines.size()) + " parts together:\n";
  std::size_t kind = 0, name = 0, row = 0;
  for (const ConflictLine& line : lines) {
    kind = std::max(kind, line.kind.size());
    name = std::max(name, line.name.size());
    row = std::max(row, line.text.size());
  }
  const auto padded = [](const std::string& word, std::size_t width) {
    return word + std::string(width - std::min(width, word.size()) + 2, ' ');
  };
  bool relaxed = false;
  for (std::size_t k = 0; k < std::min(lines.size(), kMostLines); ++k) {
    const ConflictLine& line = lines[k];
    text += "    " + padded(line.kind, kind) + padded(line.name, name) + line.text;
    if (line.relax) {
      text += std::string(row - line.text.size() + 2, ' ') + "by " + number(*line.relax);
      relaxed = true;
    }
    text += "\n";
  }
  if (lines.size() > kMostLines)
    text += "    ... and " + std::to_string(lines.size() - kMostLines) + " more (see --output json)\n";
  text += "  relax           ";
  if (conflict.minimal) {
    text += one ? "it" : "any one of them";
    text += relaxed ? ", by as much as stands beside it" : "";
    text += one ? ": it has a point then" : ": all of them have a point then";
    text += "; other conflicts may remain\n";
  } else {
    text += "one of them; perhaps fewer parts conflict already\n";
  }
  return text + "  explained by    " + terminal_text(conflict.detail) + "\n";
}

Json conflict_json(const Conflict& conflict, const std::vector<ConflictLine>& lines) {
  Json json;
  json["equalities"] = conflict.equalities;
  json["inequalities"] = conflict.inequalities;
  json["left_sides"] = conflict.left_sides;
  json["right_sides"] = conflict.right_sides;
  json["complementarities"] = conflict.complementarities;
  json["minimal"] = conflict.minimal;
  json["detail"] = conflict.detail;
  json["linear_programs"] = conflict.linear_programs;
  json["factorizations"] = conflict.factorizations;
  if (lines.empty()) return json;
  json["parts"] = Json::array();
  for (const ConflictLine& line : lines) {
    Json part{{"kind", line.kind}, {"index", line.index}, {"name", line.name}, {"text", line.text}};
    if (line.relax) part["relax"] = *line.relax;
    json["parts"].push_back(std::move(part));
  }
  return json;
}

}  // namespace marble::cli
