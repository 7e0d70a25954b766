#include "nl/nl_problem.h"

#include <algorithm>
#include <utility>

#include "file_bytes.h"
#include "nl/nl_segments.h"

namespace marble::formats {
namespace {

constexpr int kMany = 0x7fffffff;

// Operators of .nl expressions of degree at most two.
enum Operator : int {
  kPlus = 0,
  kMinus = 1,
  kTimes = 2,
  kDivide = 3,
  kPower = 5,
  kNegate = 16,
  kSum = 54,
  kPowerOfConstantExponent = 76,
  kSquare = 77,
};

class NlReader final : NlSegments {
 public:
  NlReader(std::string_view content, const NlNames& names)
      : NlSegments(content, names, "an LCQP"), most_terms_(most_numbers(content.size())) {}

  Expected<NlProblem> read(const std::string& name) {
    MARBLE_RETURN_IF_ERROR(read_segments());
    return as_lcqp(std::move(model_), name, names_);
  }

 private:
  void read_row(int row) override {
    Quadratic body = expression();
    if (body.degree() == 2)
      in_.fail("C" + std::to_string(row), "quadratic", "must be linear: constraints of an LCQP are");
    if (!in_.failed()) keep(std::move(body), model_.rows[at(row)]);
  }

  void read_objective() override { keep(expression(), model_.objective); }

  void read_definition(int index, Terms linear) override {
    Quadratic value;
    for (const auto& [variable, coefficient] : linear) value.linear[variable] += coefficient;
    value.add(expression());
    keep(std::move(value), defined_[index]);
  }

  void add_row_term(int row, Index variable, double coefficient) override {
    model_.rows[at(row)].linear[variable] += coefficient;
  }
  void add_objective_term(Index variable, double coefficient) override {
    model_.objective.linear[variable] += coefficient;
  }

  // With defined variables and products a short file can produce any number of terms: the number of live ones
  // is bounded.
  bool has_room(std::size_t terms) {
    if (held_ + terms <= most_terms_) return true;
    in_.fail("expression", std::to_string(held_ + terms) + " terms",
             "must have no more than " + std::to_string(most_terms_) + " in a file of " +
                 std::to_string(length_) + " bytes");
    return false;
  }
  void add(Quadratic value, Quadratic& sum, double factor = 1.0) {
    if (has_room(value.terms() + sum.terms())) sum.add(std::move(value), factor);
  }
  // Keeps the value permanently, as a row, a defined variable or the objective.
  void keep(Quadratic value, Quadratic& part) {
    const std::size_t terms = value.terms();
    add(std::move(value), part);
    held_ += terms;
  }
  Quadratic expression_beside(const Quadratic& held) {
    const std::size_t terms = held.terms();
    held_ += terms;
    Quadratic value = expression();
    held_ -= terms;
    return value;
  }

  Quadratic expression() {
    descend();
    Quadratic value;
    if (!in_.failed()) value = node();
    ascend();
    return value;
  }

  Quadratic node() {
    switch (const char key = in_.key()) {
      case 'n':
        return Quadratic::of(in_.real("constant"));
      case 's':
      case 'l':
        return Quadratic::of(in_.short_constant(key));
      case 'v':
        return variable(in_.integer("v", 0, kMany));
      case 'o':
        return operation(in_.integer("o", 0, kMany));
      default:
        in_.fail("expression", std::string(1, key), "must be n, v or o: nothing else is in an LCQP");
        return {};
    }
  }

  Quadratic variable(int index) {
    if (index < header_.variables) return Quadratic::variable(index);
    const auto found = defined_.find(index);
    if (found != defined_.end()) return found->second;
    in_.fail("v", std::to_string(index), "is no variable");
    return {};
  }

  Quadratic operation(int code) {
    switch (code) {
      case kPlus:
      case kMinus: {
        Quadratic sum = expression();
        add(expression_beside(sum), sum, code == kPlus ? 1.0 : -1.0);
        return sum;
      }
      case kNegate:
        return expression().times(-1.0);
      case kSum: {
        Quadratic sum;
        for (int count = in_.integer("o54", 0, kMany); count > 0 && !in_.failed(); --count)
          add(expression_beside(sum), sum);
        return sum;
      }
      case kTimes: {
        const Quadratic left = expression();
        return product(left, expression_beside(left));
      }
      case kSquare: {
        const Quadratic base = expression();
        return product(base, base);
      }
      case kDivide:
        return quotient();
      case kPower:
      case kPowerOfConstantExponent:
        return power();
      default:
        in_.fail("o" + std::to_string(code), operator_name(code), "is an operator that no LCQP has");
        return {};
    }
  }

  Quadratic product(const Quadratic& left, const Quadratic& right) {
    Quadratic result;
    if (!has_room(left.terms() + right.terms() + left.linear.size() * right.linear.size())) return result;
    if (!multiply(left, right, result))
      in_.fail("o2", "degree " + std::to_string(left.degree() + right.degree()), "must be quadratic at most");
    return result;
  }

  Quadratic quotient() {
    const Quadratic left = expression();
    const Quadratic right = expression_beside(left);
    if (right.degree() == 0 && right.constant != 0.0) return left.times(1.0 / right.constant);
    in_.fail("o3", "", "must divide by a constant other than 0");
    return {};
  }

  Quadratic power() {
    Quadratic base = expression();
    const Quadratic exponent = expression_beside(base);
    if (exponent.degree() == 0 && exponent.constant == 0.0) return Quadratic::of(1.0);
    if (exponent.degree() == 0 && exponent.constant == 1.0) return base;
    if (exponent.degree() == 0 && exponent.constant == 2.0) return product(base, base);
    in_.fail("o5", "", "must have the exponent 0, 1 or 2");
    return {};
  }

  const std::size_t most_terms_;
  std::size_t held_ = 0;
  std::map<int, Quadratic> defined_;
};

}  // namespace

Expected<NlProblem> parse_nl_problem(std::string_view content, const std::string& name,
                                     const NlNames& names) {
  return NlReader(content, names).read(name);
}

Expected<ProblemFile> parse_nl(std::string_view content, const std::string& name, const NlNames& names) {
  MARBLE_ASSIGN_OR_RETURN(auto problem, parse_nl_problem(content, name, names));
  return std::move(problem.file);
}

}  // namespace marble::formats
