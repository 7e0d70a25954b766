#include "nl/expression_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

#include "file_bytes.h"
#include "nl/nl_segments.h"

namespace marble::formats {
namespace {

constexpr int kMany = 0x7fffffff;
constexpr std::size_t kLongest = 512;         // bytes of a defined variable that is inlined
constexpr std::size_t kLeastOfOperation = 5;  // bytes, in addition to its operands

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

/// Numbers in the machine's byte order, as the library reads them.
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
  [[nodiscard]] std::size_t size() const { return text_.size(); }
  void cut(std::size_t size) { text_.resize(size); }
  [[nodiscard]] std::string take() { return std::exchange(text_, {}); }

 private:
  BinaryText& raw(const void* bytes, std::size_t size) {
    return text_.append(static_cast<const char*>(bytes), size), *this;
  }
  std::string text_;
};

/// Bounds on an expression, without its values.
struct Shape {
  std::size_t variables = 0;  ///< at most as many variables in it
  std::size_t entries = 0;    ///< at most as many in its second derivatives
  std::optional<double> constant = {};
};

double value_of(int code, double x) {
  switch (code) {
    case kAbs:
      return std::abs(x);
    case kNegate:
      return -x;
    case 37:
      return std::tanh(x);
    case 38:
      return std::tan(x);
    case 39:
      return std::sqrt(x);
    case 40:
      return std::sinh(x);
    case 41:
      return std::sin(x);
    case 42:
      return std::log10(x);
    case 43:
      return std::log(x);
    case 44:
      return std::exp(x);
    case 45:
      return std::cosh(x);
    case 46:
      return std::cos(x);
    case 47:
      return std::atanh(x);
    case 49:
      return std::atan(x);
    case 50:
      return std::asinh(x);
    case 51:
      return std::asin(x);
    case 52:
      return std::acosh(x);
    default:
      return std::acos(x);
  }
}

double value_of(int code, double x, double y) {
  switch (code) {
    case kPlus:
    case kSum:
      return x + y;
    case kMinus:
      return x - y;
    case kTimes:
      return x * y;
    case kDivide:
      return x / y;
    case kLess:
      return std::max(x - y, 0.0);
    case kAtan2:
      return std::atan2(x, y);
    case kMin:
      return std::min(x, y);
    case kMax:
      return std::max(x, y);
    default:
      return std::pow(x, y);
  }
}

class Rewriter final : NlSegments {
 public:
  Rewriter(std::string_view content, const NlNames& names)
      : NlSegments(content, names, "a smooth model"), most_(most_numbers(content.size())) {}

  Expected<ExpressionFile> read() {
    MARBLE_RETURN_IF_ERROR(read_segments());
    if (header_.variables == 0) return unexpected(invalid("header", "0 variables", "must be one at least"));
    rows_.resize(at(header_.constraints));
    model_.row_bounds.resize(rows_.size() + lifted_.size(), NlBounds{0.0, 0.0});
    rows_.insert(rows_.end(), std::make_move_iterator(lifted_.begin()),
                 std::make_move_iterator(lifted_.end()));
    const auto n = static_cast<Index>(variables()), m = static_cast<Index>(rows_.size());
    model_.rows.resize(rows_.size());
    for (Index row = 0; row < m; ++row) model_.rows[at(row)] = Quadratic::variable(n + row);
    model_.bounds.resize(at(n) + at(m));
    ExpressionFile made;
    made.content = written();
    made.header = std::move(header_);
    made.lifted = std::move(lifted_numbers_);
    made.model = std::move(model_);
    return made;
  }

 private:
  /// A row or the objective: its expression to be written, and its linear part.
  struct Part {
    std::string expression;
    std::map<Index, double> linear;  // with a zero if a variable is only in the expression
  };
  // A defined variable: its expression, or the variable that replaces it.
  struct Definition {
    std::string text;
    Shape shape;
    std::vector<Index> variables;  // in the expression
  };

  void read_row(int row) override { read_part(rows_at(row)); }
  void read_objective() override { read_part(objective_); }

  // The library's second derivatives are wrong for nested defined variables, so it gets none: a short one is
  // inlined. A long one becomes a variable, defined by its own row.
  void read_definition(int index, Terms linear) override {
    BinaryText text;
    if (linear.size() == 1) text.operation(kPlus);
    if (linear.size() > 1) text.operation(kSum).integer(static_cast<std::int64_t>(linear.size()) + 1);
    for (const auto& [variable, coefficient] : linear) {
      use(variable);
      text.operation(kTimes).constant(checked(coefficient)).key('v').integer(variable);
    }
    Shape shape = expression();
    if (!linear.empty()) shape.constant.reset();
    shape.variables += linear.size();
    Definition made{text.append(out_.take()).take(), capped(shape), take_used()};
    if (definitions_.contains(index)) return in_.fail("V", std::to_string(index), "must be defined once");
    if (made.text.size() > kLongest) {
      const auto variable = static_cast<Index>(variables());
      Part& row = lifted_.emplace_back();
      row.expression = std::move(made.text);
      for (const Index used : made.variables) row.linear.try_emplace(used, 0.0);
      row.linear[variable] = -1.0;
      count(made.shape);
      lifted_numbers_.push_back(index);
      made = {BinaryText().key('v').integer(variable).take(), {1, 0, {}}, {variable}};
    }
    definitions_.emplace(index, std::move(made));
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
    count(shape);
  }

  void count(const Shape& shape) {
    entries_ = capped(Shape{0, entries_ + shape.entries, {}}).entries;
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

  // Marks variables of the part that is read.
  void use(Index variable) {
    if (marks_.size() < variables()) marks_.resize(variables(), false);
    if (marks_[at(variable)]) return;
    marks_[at(variable)] = true;
    used_.push_back(variable);
  }
  std::vector<Index> take_used() {
    for (const Index variable : used_) marks_[at(variable)] = false;
    std::sort(used_.begin(), used_.end());
    return std::exchange(used_, {});
  }

  // The file's variables, and those that replace defined variables.
  [[nodiscard]] std::size_t variables() const { return at(header_.variables) + lifted_.size(); }
  [[nodiscard]] Shape capped(const Shape& shape) const {
    const std::size_t n = variables();
    return {std::min(shape.variables, n), std::min(shape.entries, n * n), shape.constant};
  }
  static Shape beside(const Shape& a, const Shape& b) {
    return {a.variables + b.variables, a.entries + b.entries, {}};
  }
  // For an operator that may be nonlinear: every variable with every other one.
  [[nodiscard]] Shape bent(const Shape& inside) const {
    const std::size_t n = std::min(inside.variables, variables());
    return {n, n * n, {}};
  }

  // A constant subexpression is written as its value: the library's second derivatives require this.
  Shape expression() {
    descend();
    Shape shape;
    const std::size_t begin = out_.size();
    if (!in_.failed()) shape = node();
    ascend();
    if (shape.constant && !in_.failed()) {
      if (!std::isfinite(*shape.constant)) in_.fail("expression", "", "is a constant without a value");
      out_.cut(begin);
      out_.constant(*shape.constant);
    }
    return capped(shape);
  }

  Shape node() {
    switch (const char key = in_.key()) {
      case 'n':
        return {0, 0, checked(in_.real("constant"))};
      case 's':
      case 'l':
        return {0, 0, checked(in_.short_constant(key))};
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
      return {1, 0, {}};
    }
    const auto found = definitions_.find(index);
    if (found == definitions_.end()) {
      in_.fail("v", std::to_string(index), "is no variable");
      return {};
    }
    const Definition& definition = found->second;
    for (const Index used : definition.variables) use(used);
    descend(definition.text.size() / kLeastOfOperation);
    ascend();
    put_in_ += definition.text.size();
    if (put_in_ > most_bytes(length_))
      in_.fail("v", std::to_string(index),
               "is used too often for a file of " + std::to_string(length_) + " bytes");
    out_.append(definition.text);
    return definition.shape;
  }

  Shape operation(int code) {
    switch (code) {
      case kPlus:
      case kMinus:
      case kTimes:
      case kDivide:
      case kPower:
      case kLess:
      case kAtan2:
        return two(code);
      case kPowerOfConstantExponent:
      case kPowerOfConstantBase:  // the library finds out which of the two is constant
        return two(kPower);
      case kSquare: {
        out_.operation(kPower);
        const Shape base = expression();
        out_.constant(2.0);
        return with_constant(bent(base), kPower, base, {0, 0, 2.0});
      }
      case kSum: {  // the library requires at least three operands
        const int count = in_.integer("o54", 0, kMany);
        if (count == 0) return {0, 0, 0.0};
        if (count > 2) out_.operation(kSum).integer(count);
        if (count == 2) out_.operation(kPlus);
        return several(kSum, count);
      }
      case kMin:
      case kMax: {
        const int count = in_.integer(code == kMin ? "o11" : "o12", 1, kMany);
        if (count > 1) out_.operation(code).integer(count);
        const Shape all = several(code, count);
        Shape shape = bent(all);
        shape.constant = all.constant;
        return shape;
      }
      case kIf: {
        out_.operation(code);
        const Shape asked = condition();
        const Shape then = expression();
        return bent(beside(asked, beside(then, expression())));
      }
      default:
        break;
    }
    if (code != kAbs && code != kNegate && (code < kFirstOfFunctions || code > kLastOfFunctions)) {
      in_.fail("o" + std::to_string(code), operator_name(code), "is an operator that no smooth model has");
      return {};
    }
    out_.operation(code);
    const Shape inside = expression();
    if (inside.constant) return {0, 0, value_of(code, *inside.constant)};
    return code == kNegate ? inside : bent(inside);
  }

  static Shape with_constant(Shape shape, int code, const Shape& left, const Shape& right) {
    if (left.constant && right.constant) return {0, 0, value_of(code, *left.constant, *right.constant)};
    return shape;
  }

  Shape two(int code) {
    out_.operation(code);
    const Shape left = expression(), right = expression();
    const bool straight = code == kPlus || code == kMinus ||
                          (code == kTimes && (left.constant || right.constant)) ||
                          (code == kDivide && right.constant);
    return with_constant(straight ? beside(left, right) : bent(beside(left, right)), code, left, right);
  }

  Shape several(int code, int count) {
    Shape all = expression();
    for (; count > 1 && !in_.failed(); --count) {
      const Shape next = expression();
      all = capped(with_constant(beside(all, next), code, all, next));
    }
    return all;
  }

  // Reads the condition of "if": comparisons, and logical combinations of them.
  Shape condition() {
    descend();
    Shape shape;
    const char key = in_.key();
    const int code = key == 'o' ? in_.integer("o", 0, kMany) : -1;
    if (in_.failed()) {
      // keeps the first error
    } else if (std::ranges::find(kComparisons, code) != std::end(kComparisons)) {
      out_.operation(code);
      const Shape left = expression();
      shape = beside(left, expression());
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
    ascend();
    return shape;
  }

  static void add_linear(const Part& part, char key, std::size_t number, BinaryText& text) {
    if (part.linear.empty()) return;
    text.key(key).integer(static_cast<std::int64_t>(number));
    text.integer(static_cast<std::int64_t>(part.linear.size()));
    for (const auto& [variable, coefficient] : part.linear) text.integer(variable).real(coefficient);
  }

  // The library takes the derivative of a variable that is a whole expression as 0.
  static void add_expression(const Part& part, BinaryText& text) {
    if (part.expression.empty()) return void(text.constant(0.0));
    if (part.expression.front() == 'v') text.operation(kTimes).constant(1.0);
    text.append(part.expression);
  }

  // Declares all variables and rows nonlinear, so that their order is free.
  std::string written() {
    const std::size_t n = variables(), m = rows_.size();
    std::vector<std::int64_t> columns(n, 0);
    std::size_t entries = 0;
    for (const Part& row : rows_) {
      entries += row.linear.size();
      for (const auto& [variable, coefficient] : row.linear) ++columns[at(variable)];
    }
    const std::string width = std::to_string(n), height = std::to_string(m);
    BinaryText text;
    text.append("b3 0 1 0\n " + width + " " + height + " 1 0 0\n " + height + " 1\n 0 0\n " + width + " " +
                width + " " + width + "\n 0 0 0 1\n 0 0 0 0 0\n " + std::to_string(entries) + " " +
                std::to_string(objective_.linear.size()) + "\n 0 0\n 0 0 0 0 0\n");
    for (std::size_t row = 0; row < m; ++row)
      add_expression(rows_[row], text.key('C').integer(static_cast<std::int64_t>(row)));
    add_expression(objective_, text.key('O').integer(0).integer(0));
    if (m > 0) text.key('r').append(std::string(m, '3'));
    text.key('b').append(std::string(n, '3'));
    text.key('k').integer(static_cast<std::int64_t>(n) - 1);
    for (std::size_t j = 0, sum = 0; j + 1 < n; ++j)
      text.integer(static_cast<std::int64_t>(sum += static_cast<std::size_t>(columns[j])));
    for (std::size_t row = 0; row < m; ++row) add_linear(rows_[row], 'J', row, text);
    add_linear(objective_, 'G', 0, text);
    return text.take();
  }

  const std::size_t most_;   // numbers that may be stored
  std::size_t entries_ = 0;  // of second derivatives, so far
  std::size_t put_in_ = 0;   // bytes of inlined defined variables
  BinaryText out_;           // the expression being read
  std::map<int, Definition> definitions_;
  std::vector<Part> rows_, lifted_;
  std::vector<int> lifted_numbers_;  // the file's, for defined variables that became variables
  Part objective_;
  std::vector<bool> marks_;
  std::vector<Index> used_;
};

}  // namespace

Expected<ExpressionFile> read_expressions(std::string_view content, const NlNames& names) {
  return Rewriter(content, names).read();
}

}  // namespace marble::formats
