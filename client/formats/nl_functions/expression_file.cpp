#include "nl_functions/expression_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>

#include "nl/nl_segments.h"
#include "parts/file_limits.h"

namespace marble::formats {
namespace {

constexpr int kMany = 0x7fffffff;
constexpr int kDeepest = 10'000;  // nodes within nodes

// Gay, "Writing .nl Files", table 5.
enum Operator : int {
  kPlus = 0,
  kMinus = 1,
  kTimes = 2,
  kDivide = 3,
  kPower = 5,
  kLess = 6,
  kMin = 11,
  kMax = 12,
  kAbs = 15,
  kNegate = 16,
  kOr = 20,
  kAnd = 21,
  kNot = 34,
  kIf = 35,
  kFirstOfFunctions = 37,  // tanh
  kAtan2 = 48,
  kLastOfFunctions = 53,  // acos
  kSum = 54,
  kPowerOfConstantExponent = 76,
  kSquare = 77,
  kPowerOfConstantBase = 78,
};
constexpr int kComparisons[] = {22, 23, 24, 28, 29, 30};

/// Numbers of the machine's own, as the library reads them.
class BinaryText {
 public:
  BinaryText& key(char c) { return text_ += c, *this; }
  BinaryText& integer(std::int64_t value) {
    const auto narrow = static_cast<std::int32_t>(value);
    return raw(&narrow, sizeof narrow);
  }
  BinaryText& real(double value) { return raw(&value, sizeof value); }
  BinaryText& operation(int code) { return key('o').integer(code); }
  BinaryText& constant(double value) { return key('n').real(value); }
  BinaryText& append(const std::string& text) { return text_ += text, *this; }
  [[nodiscard]] std::string take() { return std::exchange(text_, {}); }

 private:
  BinaryText& raw(const void* bytes, std::size_t size) {
    return text_.append(static_cast<const char*>(bytes), size), *this;
  }
  std::string text_;
};

/// What is known of an expression without its values.
struct Shape {
  std::size_t variables = 0;  ///< at most that many in it
  std::size_t entries = 0;    ///< that its second derivatives have at most
};

class Rewriter final : NlSegments {
 public:
  Rewriter(std::string_view content, const NlNames& names)
      : NlSegments(content, names, "a smooth model"), most_(most_numbers(content.size())) {}

  Expected<ExpressionFile> read() {
    if (const auto read = read_segments(); !read) return unexpected(read.error());
    if (header_.variables == 0) return unexpected(invalid("header", "0 variables", "must be one at least"));
    const auto n = static_cast<Index>(header_.variables);
    const auto m = static_cast<Index>(header_.constraints);
    rows_.resize(at(m));
    for (Index row = 0; row < m; ++row) model_.rows[at(row)] = Quadratic::variable(n + row);
    model_.bounds.resize(at(n) + at(m));
    ExpressionFile made;
    made.content = written();
    made.header = std::move(header_);
    made.model = std::move(model_);
    return made;
  }

 private:
  /// A row or the objective: its expression as it is to be read again, and its linear part.
  struct Part {
    std::string expression;
    std::map<Index, double> linear;  // with a zero where a variable is in the expression alone
  };
  struct Definition {
    int number;
    Shape shape;
    std::vector<Index> variables;  // in it, sorted
  };

  void read_row(int row) override { read_part(rows_at(row)); }
  void read_objective() override { read_part(objective_); }

  void read_definition(int index, Terms linear) override {
    for (const auto& [variable, coefficient] : linear) use(variable);
    BinaryText text;
    text.key('V').integer(header_.variables + static_cast<int>(definitions_.size()));
    text.integer(static_cast<std::int64_t>(linear.size())).integer(0);
    for (const auto& [variable, coefficient] : linear) text.integer(variable).real(checked(coefficient));
    Shape shape = expression();
    shape.variables = capped(shape.variables + linear.size());
    definitions_text_ += text.append(out_.take()).take();
    std::vector<Index> used = take_used();
    if (!has_room(used.size())) return;
    if (definitions_.contains(index)) return in_.fail("V", std::to_string(index), "must be defined once");
    const auto number = static_cast<int>(definitions_.size());
    definitions_.emplace(index, Definition{number, shape, std::move(used)});
  }

  void add_row_term(int row, Index variable, double coefficient) override {
    rows_at(row).linear[variable] += checked(coefficient);
  }
  void add_objective_term(Index variable, double coefficient) override {
    objective_.linear[variable] += checked(coefficient);
  }

  Part& rows_at(int row) {
    rows_.resize(at(header_.constraints));
    return rows_[at(row)];
  }

  void read_part(Part& part) {
    if (!part.expression.empty()) in_.fail("expression", "", "must be there once");
    const Shape shape = expression();
    part.expression = out_.take();
    for (const Index variable : take_used()) part.linear.try_emplace(variable, 0.0);
    entries_ = capped(Shape{0, entries_ + shape.entries}).entries;
    if (entries_ > most_) {
      in_.fail("expression", std::to_string(entries_) + " second derivatives",
               "must have no more than " + std::to_string(most_) + " in a file of " +
                   std::to_string(length_) + " bytes");
    }
  }

  double checked(double number) {
    if (!std::isfinite(number)) in_.fail("number", std::to_string(number), "must be finite");
    return number;
  }

  bool has_room(std::size_t more) {
    held_ += more;
    if (held_ <= most_) return true;
    in_.fail("V", std::to_string(held_) + " variables in defined variables",
             "must be no more than " + std::to_string(most_) + " in a file of " + std::to_string(length_) +
                 " bytes");
    return false;
  }

  // Variables of the part that is read.
  void use(Index variable) {
    if (marks_.size() < at(header_.variables)) marks_.resize(at(header_.variables), false);
    if (marks_[at(variable)]) return;
    marks_[at(variable)] = true;
    used_.push_back(variable);
  }
  std::vector<Index> take_used() {
    for (const Index variable : used_) marks_[at(variable)] = false;
    std::sort(used_.begin(), used_.end());
    return std::exchange(used_, {});
  }

  [[nodiscard]] std::size_t capped(std::size_t variables) const {
    return std::min(variables, at(header_.variables));
  }
  [[nodiscard]] Shape capped(const Shape& shape) const {
    const auto n = at(header_.variables);
    return {capped(shape.variables), std::min(shape.entries, n * n)};
  }
  static Shape beside(const Shape& a, const Shape& b) {
    return {a.variables + b.variables, a.entries + b.entries};
  }
  // Of an operator that may bend: every variable with every other one.
  [[nodiscard]] Shape bent(const Shape& inside) const {
    const std::size_t variables = capped(inside.variables);
    return {variables, variables * variables};
  }

  Shape expression() {
    if (++depth_ > kDeepest) in_.fail("expression", "", "is nested too deeply");
    Shape shape;
    if (!in_.failed()) shape = node();
    --depth_;
    return capped(shape);
  }

  Shape node() {
    switch (const char key = in_.key()) {
      case 'n':
        out_.constant(checked(in_.real("constant")));
        return {};
      case 's':
      case 'l':
        out_.constant(checked(in_.short_constant(key)));
        return {};
      case 'v':
        return variable(in_.integer("v", 0, kMany));
      case 'o':
        return operation(in_.integer("o", 0, kMany));
      default:
        in_.fail("expression", std::string(1, key), "must be n, v or o");
        return {};
    }
  }

  Shape variable(int index) {
    if (index < header_.variables) {
      use(index);
      out_.key('v').integer(index);
      return {1, 0};
    }
    const auto found = definitions_.find(index);
    if (found == definitions_.end()) {
      in_.fail("v", std::to_string(index), "is no variable");
      return {};
    }
    const Definition& definition = found->second;
    for (const Index used : definition.variables) use(used);
    out_.key('v').integer(header_.variables + definition.number);
    return definition.shape;
  }

  Shape operation(int code) {
    switch (code) {
      case kPlus:
      case kMinus:
        out_.operation(code);
        return two([](const Shape& a, const Shape& b) { return beside(a, b); });
      case kTimes:
      case kDivide:
      case kPower:
      case kLess:
      case kAtan2:
        out_.operation(code);
        return two([this](const Shape& a, const Shape& b) { return bent(beside(a, b)); });
      case kPowerOfConstantExponent:
      case kPowerOfConstantBase:  // which of the two is constant is for the library to see
        out_.operation(kPower);
        return two([this](const Shape& a, const Shape& b) { return bent(beside(a, b)); });
      case kSquare: {
        out_.operation(kPower);
        const Shape base = expression();
        out_.constant(2.0);
        return bent(base);
      }
      case kNegate:
        out_.operation(code);
        return expression();
      case kSum:
        return sum();
      case kMin:
      case kMax:
        return extremum(code);
      case kIf: {
        out_.operation(code);
        const Shape asked = condition();
        const Shape then = expression();
        return bent(beside(asked, beside(then, expression())));
      }
      default:
        if (code != kAbs && (code < kFirstOfFunctions || code > kLastOfFunctions)) {
          in_.fail("o" + std::to_string(code), operator_name(code),
                   "is an operator that no smooth model has");
          return {};
        }
        out_.operation(code);
        return bent(expression());
    }
  }

  template <class Join>
  Shape two(const Join& join) {
    const Shape left = expression();
    return join(left, expression());
  }

  // The library wants three parts at least.
  Shape sum() {
    int count = in_.integer("o54", 0, kMany);
    if (count == 0) out_.constant(0.0);
    if (count == 2) out_.operation(kPlus);
    if (count > 2) out_.operation(kSum).integer(count);
    Shape all;
    for (; count > 0 && !in_.failed(); --count) {
      all = capped(beside(all, expression()));
    }
    return all;
  }

  Shape extremum(int code) {
    int count = in_.integer(code == kMin ? "o11" : "o12", 1, kMany);
    out_.operation(code).integer(count);
    Shape all;
    for (; count > 0 && !in_.failed(); --count) {
      all = capped(beside(all, expression()));
    }
    return bent(all);
  }

  // What "if" asks: comparisons, and what logic makes of them.
  Shape condition() {
    if (++depth_ > kDeepest) in_.fail("expression", "", "is nested too deeply");
    Shape shape;
    const char key = in_.key();
    const int code = key == 'o' ? in_.integer("o", 0, kMany) : -1;
    if (in_.failed()) {
      // its reason stands
    } else if (std::ranges::find(kComparisons, code) != std::end(kComparisons)) {
      out_.operation(code);
      shape = two([](const Shape& a, const Shape& b) { return beside(a, b); });
    } else if (code == kOr || code == kAnd) {
      out_.operation(code);
      const Shape left = condition();
      shape = beside(left, condition());
    } else if (code == kNot) {
      out_.operation(code);
      shape = condition();
    } else {
      in_.fail("o35", "", "must ask for a comparison");
    }
    --depth_;
    return shape;
  }

  static void add_linear(const Part& part, char key, std::size_t number, BinaryText& text) {
    if (part.linear.empty()) return;
    text.key(key).integer(static_cast<std::int64_t>(number));
    text.integer(static_cast<std::int64_t>(part.linear.size()));
    for (const auto& [variable, coefficient] : part.linear) text.integer(variable).real(coefficient);
  }

  // All variables and rows are told to be nonlinear, so none has to stand before another one.
  std::string written() {
    const std::size_t n = at(header_.variables), m = rows_.size();
    std::vector<std::int64_t> columns(n, 0);
    std::size_t entries = 0;
    for (const Part& row : rows_) {
      entries += row.linear.size();
      for (const auto& [variable, coefficient] : row.linear) ++columns[at(variable)];
    }
    const std::string variables = std::to_string(n), rows = std::to_string(m);
    BinaryText text;
    text.append("b3 0 1 0\n " + variables + " " + rows + " 1 0 0\n " + rows + " 1\n 0 0\n " + variables +
                " " + variables + " " + variables + "\n 0 0 0 1\n 0 0 0 0 0\n " + std::to_string(entries) +
                " " + std::to_string(objective_.linear.size()) + "\n 0 0\n " +
                std::to_string(definitions_.size()) + " 0 0 0 0\n");
    text.append(definitions_text_);
    const std::string zero = BinaryText().constant(0.0).take();
    for (std::size_t row = 0; row < m; ++row) {
      text.key('C').integer(static_cast<std::int64_t>(row));
      text.append(rows_[row].expression.empty() ? zero : rows_[row].expression);
    }
    text.key('O').integer(0).integer(0);
    text.append(objective_.expression.empty() ? zero : objective_.expression);
    if (m > 0) text.key('r').append(std::string(m, '3'));
    text.key('b').append(std::string(n, '3'));
    text.key('k').integer(static_cast<std::int64_t>(n) - 1);
    for (std::size_t j = 0, sum = 0; j + 1 < n; ++j)
      text.integer(static_cast<std::int64_t>(sum += static_cast<std::size_t>(columns[j])));
    for (std::size_t row = 0; row < m; ++row) add_linear(rows_[row], 'J', row, text);
    add_linear(objective_, 'G', 0, text);
    return text.take();
  }

  const std::size_t most_;   // numbers that may be held
  std::size_t entries_ = 0;  // of second derivatives, so far
  std::size_t held_ = 0;     // variables of defined variables
  int depth_ = 0;
  BinaryText out_;  // the expression that is read
  std::string definitions_text_;
  std::map<int, Definition> definitions_;
  std::vector<Part> rows_;
  Part objective_;
  std::vector<bool> marks_;
  std::vector<Index> used_;
};

}  // namespace

Expected<ExpressionFile> read_expressions(std::string_view content, const NlNames& names) {
  return Rewriter(content, names).read();
}

}  // namespace marble::formats
