#include "nl/nl_problem.h"

#include <algorithm>
#include <utility>

#include "nl/nl_model.h"
#include "nl/nl_tokens.h"
#include "parts/file_limits.h"

namespace marble::formats {
namespace {

constexpr int kMany = 0x7fffffff;
constexpr int kDeepest = 10'000;  // nodes within nodes

// Operators of .nl expressions that keep to degree two.
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

// Of those that do not, what people call them (Gay, table 5).
struct NamedOperator {
  int code;
  const char* name;
};
constexpr NamedOperator kOthers[] = {{4, "rem"},
                                     {6, "less"},
                                     {11, "min"},
                                     {12, "max"},
                                     {13, "floor"},
                                     {14, "ceil"},
                                     {15, "abs"},
                                     {35, "if"},
                                     {37, "tanh"},
                                     {38, "tan"},
                                     {39, "sqrt"},
                                     {40, "sinh"},
                                     {41, "sin"},
                                     {42, "log10"},
                                     {43, "log"},
                                     {44, "exp"},
                                     {45, "cosh"},
                                     {46, "cos"},
                                     {47, "atanh"},
                                     {48, "atan2"},
                                     {49, "atan"},
                                     {50, "asinh"},
                                     {51, "asin"},
                                     {52, "acosh"},
                                     {53, "acos"},
                                     {55, "div"},
                                     {56, "precision"},
                                     {57, "round"},
                                     {58, "trunc"},
                                     {64, "piecewise linear"},
                                     {78, "a constant to a power"}};

std::string operator_name(int code) {
  const auto* const found = std::ranges::find(kOthers, code, &NamedOperator::code);
  return found == std::end(kOthers) ? "" : found->name;
}

class NlReader {
 public:
  NlReader(std::string_view content, const NlNames& names)
      : in_(content), names_(names), most_terms_(most_numbers(content.size())), length_(content.size()) {}

  Expected<NlProblem> read(const std::string& name) {
    header_ = in_.header();
    check_header();
    if (!in_.failed()) {
      model_.rows.resize(static_cast<std::size_t>(header_.constraints));
      model_.row_bounds.resize(model_.rows.size());
      model_.bounds.resize(static_cast<std::size_t>(header_.variables));
      while (const char key = in_.key()) {
        segment(key);
        if (in_.failed()) break;
      }
      check_complete();
    }
    if (in_.failed()) return unexpected(place_.named(in_.error(), names_));
    return as_lcqp(std::move(model_), name, names_);
  }

 private:
  using Kind = NlPlace::Kind;

  // What of the model is being read: a fault names it.
  void enter(Kind kind, int index = 0) {
    if (!in_.failed()) place_ = {kind, index};
  }

  void check_header() {
    const auto refuse = [&](std::int64_t count, const char* what) {
      if (count > 0) in_.fail("header", std::to_string(count) + " " + what, "must be none: not an LCQP");
    };
    if (header_.integers > 0) enter(Kind::column, header_.first_integer);
    refuse(header_.integers, "integer variables");
    refuse(header_.networks, "network constraints");
    refuse(header_.functions, "imported functions");
    refuse(header_.logical_constraints, "logical constraints");
    if (header_.objectives > 1)
      in_.fail("header", std::to_string(header_.objectives) + " objectives", "must be one at most");
    // Every variable and every constraint has a bound of a byte at least.
    if (static_cast<std::size_t>(header_.variables) + static_cast<std::size_t>(header_.constraints) >
        length_) {
      in_.fail("header",
               std::to_string(header_.variables) + " variables, " + std::to_string(header_.constraints) +
                   " constraints",
               "must be no more than the file has bytes, " + std::to_string(length_));
    }
  }

  // A file that was cut at a segment's end is a file still, but of another problem. (Rows that are linear
  // need no C.)
  void check_complete() {
    const auto need = [&](const char* key, std::int64_t there, std::int64_t told) {
      if (there >= told) return;
      in_.fail(key, std::to_string(there) + " of " + std::to_string(told),
               "is missing: the file ends too soon");
    };
    need("O", seen_.objectives, header_.objectives);
    need("r", seen_.row_bounds, header_.constraints);
    need("b", seen_.bounds, header_.variables);
    need("J", seen_.jacobian, header_.jacobian);
    need("G", seen_.gradient, header_.gradient);
  }

  void segment(char key) {
    enter(Kind::none);
    switch (key) {
      case 'C':
        return constraint();
      case 'O':
        return objective();
      case 'V':
        return defined_variable();
      case 'J':
        return jacobian_row();
      case 'G':
        static_cast<void>(in_.integer("G", 0, header_.objectives - 1));
        return linear_terms(model_.objective, seen_.gradient);
      case 'b':
        for (std::size_t i = 0; i < model_.bounds.size() && !in_.failed(); ++i) {
          enter(Kind::column, static_cast<int>(i));
          model_.bounds[i] = bound("b", false);
        }
        seen_.bounds = header_.variables;
        return;
      case 'r':
        for (std::size_t i = 0; i < model_.row_bounds.size() && !in_.failed(); ++i) {
          enter(Kind::row, static_cast<int>(i));
          model_.row_bounds[i] = bound("r", true);
        }
        seen_.row_bounds = header_.constraints;
        return;
      case 'x':
        return initial_point();
      case 'd':
        return initial_duals();
      case 'S':
        return suffix();
      case 'k':
        for (int count = in_.integer("k", 0, kMany); count > 0 && !in_.failed(); --count)
          static_cast<void>(in_.integer("k", 0, kMany));
        return;
      default:
        in_.fail("segment", std::string(1, key), "is none that an LCQP has");
    }
  }

  static std::size_t at(int index) { return static_cast<std::size_t>(index); }

  void constraint() {
    const int index = in_.integer("C", 0, header_.constraints - 1);
    enter(Kind::row, index);
    Quadratic body = expression();
    if (body.degree() == 2)
      in_.fail("C" + std::to_string(index), "quadratic", "must be linear: constraints of an LCQP are");
    if (!in_.failed()) keep(std::move(body), model_.rows[at(index)]);
  }

  void objective() {
    static_cast<void>(in_.integer("O", 0, header_.objectives - 1));
    model_.maximize = in_.integer("O", 0, 1) == 1;
    enter(Kind::objective);
    keep(expression(), model_.objective);
    ++seen_.objectives;
  }

  void defined_variable() {
    const int first = header_.variables;
    const int index = in_.integer("V", first, kMany);
    enter(Kind::definition, index);
    const int terms = in_.integer("V", 0, header_.variables);
    static_cast<void>(in_.integer("V", 0, kMany));
    Quadratic value;
    for (int i = 0; i < terms && !in_.failed(); ++i) {
      const int variable = in_.integer("V", 0, header_.variables - 1);
      value.linear[variable] += in_.real("V");
    }
    value.add(expression());
    keep(std::move(value), defined_[index]);
  }

  void jacobian_row() {
    const int index = in_.integer("J", 0, header_.constraints - 1);
    enter(Kind::row, index);
    if (!in_.failed()) linear_terms(model_.rows[at(index)], seen_.jacobian);
  }

  void linear_terms(Quadratic& sum, std::int64_t& seen) {
    for (int count = in_.integer("J", 0, header_.variables); count > 0 && !in_.failed(); --count) {
      const int variable = in_.integer("J", 0, header_.variables - 1);
      sum.linear[variable] += in_.real("J");
      ++seen;
    }
  }

  NlBounds bound(const char* what, bool may_complement) {
    NlBounds bounds;
    switch (in_.key()) {
      case '0':
        bounds.low = in_.real(what);
        bounds.high = in_.real(what);
        break;
      case '1':
        bounds.high = in_.real(what);
        break;
      case '2':
        bounds.low = in_.real(what);
        break;
      case '3':
        break;
      case '4':
        bounds.low = bounds.high = in_.real(what);
        break;
      case '5':
        if (may_complement) {
          bounds.sides = in_.integer(what, 0, kBothSides);
          bounds.complements = in_.integer(what, 1, header_.variables) - 1;
          break;
        }
        [[fallthrough]];
      default:
        in_.fail(what, "", "must be a bound: 0 to 4, in r 5 too");
    }
    return bounds;
  }

  void initial_point() {
    model_.initial.assign(model_.bounds.size(), 0.0);
    for (int count = in_.integer("x", 0, header_.variables); count > 0 && !in_.failed(); --count) {
      const int variable = in_.integer("x", 0, header_.variables - 1);
      model_.initial[at(variable)] = in_.real("x");
    }
  }

  void initial_duals() {
    model_.duals.assign(model_.rows.size(), 0.0);
    for (int count = in_.integer("d", 0, header_.constraints); count > 0 && !in_.failed(); --count) {
      const int row = in_.integer("d", 0, header_.constraints - 1);
      model_.duals[at(row)] = in_.real("d");
    }
  }

  void skip_pairs(int count) {
    for (; count > 0 && !in_.failed(); --count) {
      static_cast<void>(in_.integer("entry", 0, kMany));
      static_cast<void>(in_.real("entry"));
    }
  }

  // "S kind count name", then as many pairs; kind 4 and more have real values, which does not matter to text.
  void suffix() {
    const int kind = in_.integer("S", 0, 7);
    int count = in_.integer("S", 0, kMany);
    in_.skip_name();
    if ((kind & 4) != 0 || !header_.binary) return skip_pairs(count);
    for (; count > 0 && !in_.failed(); --count) {
      static_cast<void>(in_.integer("S", 0, kMany));
      static_cast<void>(in_.integer("S", -kMany - 1, kMany));
    }
  }

  // Defined variables and products let a short file ask for any number of terms: those that are held at a
  // time are bounded.
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
  // For good, as a row, a defined variable or the objective.
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
    if (++depth_ > kDeepest) in_.fail("expression", "", "is nested too deeply");
    Quadratic value;
    if (!in_.failed()) value = node();
    --depth_;
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

  NlTokens in_;
  const NlNames& names_;
  NlPlace place_;
  const std::size_t most_terms_, length_;
  std::size_t held_ = 0;
  NlHeader header_;
  struct {
    std::int64_t objectives = 0, row_bounds = 0, bounds = 0, jacobian = 0, gradient = 0;
  } seen_;  // of what the header tells
  NlModel model_;
  std::map<int, Quadratic> defined_;
  int depth_ = 0;
};

}  // namespace

Expected<NlProblem> parse_nl_problem(std::string_view content, const std::string& name,
                                     const NlNames& names) {
  return NlReader(content, names).read(name);
}

Expected<ProblemFile> parse_nl(std::string_view content, const std::string& name, const NlNames& names) {
  auto problem = parse_nl_problem(content, name, names);
  if (!problem) return unexpected(problem.error());
  return std::move(problem->file);
}

}  // namespace marble::formats
