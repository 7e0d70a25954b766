#include "nl/nl_problem.h"

#include <utility>

#include "nl/nl_tokens.h"
#include "nl/quadratic.h"
#include "parts/assembler.h"
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

// The k of "5 k i": which bounds of variable i the row complements.
enum Sides : int { kLowerSide = 1, kUpperSide = 2, kBothSides = 3 };

struct Bounds {
  double low = -kInfinity, high = kInfinity;
  int complements = -1;  // the variable that the row complements
  int sides = 0;         // with regard to which of its bounds
};

class NlReader {
 public:
  explicit NlReader(std::string_view content)
      : in_(content), most_terms_(most_numbers(content.size())), length_(content.size()) {}

  Expected<ProblemFile> read(const std::string& name) {
    header_ = in_.header();
    check_header();
    if (!in_.failed()) {
      rows_.resize(static_cast<std::size_t>(header_.constraints));
      row_bounds_.resize(rows_.size());
      bounds_.resize(static_cast<std::size_t>(header_.variables));
      while (const char key = in_.key()) {
        segment(key);
        if (in_.failed()) break;
      }
      check_complete();
    }
    if (in_.failed()) return unexpected(in_.error());
    return assemble(name);
  }

 private:
  void check_header() {
    const auto refuse = [&](std::int64_t count, const char* what) {
      if (count > 0) in_.fail("header", std::to_string(count) + " " + what, "must be none: not an LCQP");
    };
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
        return linear_terms(objective_, seen_.gradient);
      case 'b':
        for (std::size_t i = 0; i < bounds_.size() && !in_.failed(); ++i) bounds_[i] = bound("b", false);
        seen_.bounds = header_.variables;
        return;
      case 'r':
        for (std::size_t i = 0; i < row_bounds_.size() && !in_.failed(); ++i)
          row_bounds_[i] = bound("r", true);
        seen_.row_bounds = header_.constraints;
        return;
      case 'x':
        return initial_point();
      case 'd':
        return skip_pairs(in_.integer("d", 0, kMany));
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
    Quadratic body = expression();
    if (body.degree() == 2)
      in_.fail("C" + std::to_string(index), "quadratic", "must be linear: constraints of an LCQP are");
    if (!in_.failed()) keep(std::move(body), rows_[at(index)]);
  }

  void objective() {
    static_cast<void>(in_.integer("O", 0, header_.objectives - 1));
    maximize_ = in_.integer("O", 0, 1) == 1;
    keep(expression(), objective_);
    ++seen_.objectives;
  }

  void defined_variable() {
    const int first = header_.variables;
    const int index = in_.integer("V", first, kMany);
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
    if (!in_.failed()) linear_terms(rows_[at(index)], seen_.jacobian);
  }

  void linear_terms(Quadratic& sum, std::int64_t& seen) {
    for (int count = in_.integer("J", 0, header_.variables); count > 0 && !in_.failed(); --count) {
      const int variable = in_.integer("J", 0, header_.variables - 1);
      sum.linear[variable] += in_.real("J");
      ++seen;
    }
  }

  Bounds bound(const char* what, bool may_complement) {
    Bounds bounds;
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
    initial_.assign(bounds_.size(), 0.0);
    for (int count = in_.integer("x", 0, header_.variables); count > 0 && !in_.failed(); --count) {
      const int variable = in_.integer("x", 0, header_.variables - 1);
      initial_[at(variable)] = in_.real("x");
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
        in_.fail("o" + std::to_string(code), "", "is an operator that no LCQP has");
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

  static AffineRow affine(const Quadratic& row) {
    AffineRow result;
    result.constant = row.constant;
    result.terms.assign(row.linear.begin(), row.linear.end());
    return result;
  }

  // "5 k i". AMPL's own readers take the row's bounds from k alone (ASL's fg_read.c: lower k & 2 ? -inf : 0,
  // upper k & 1 ? inf : 0). Whatever else the variable is bounded by is a plain bound: Pyomo writes k = 1 for
  // one with two. `plain` keeps the bounds that no pair holds.
  Expected<void> add_complementarity(Assembler& problem, std::size_t index, std::vector<Bounds>& plain) {
    const int variable = row_bounds_[index].complements, sides = row_bounds_[index].sides;
    const AffineRow row = affine(rows_[index]);
    const Bounds& given = bounds_[at(variable)];
    const bool lower = (sides & kLowerSide) != 0, upper = (sides & kUpperSide) != 0;
    const auto refuse = [&](const char* rule) {
      return unexpected(invalid("r", static_cast<std::int64_t>(index),
                                "5 " + std::to_string(sides) + " " + std::to_string(variable + 1), rule));
    };
    if (lower && given.low == -kInfinity) return refuse("must complement a variable with a lower bound");
    if (upper && given.high == kInfinity) return refuse("must complement a variable with an upper bound");
    if (sides == 0 && (given.low > -kInfinity || given.high < kInfinity))
      return refuse("must complement a variable without bounds");
    if (given.low == given.high) {  // the variable stands still: its row may do what the sides allow
      if (sides == kBothSides) return {};
      return problem.add_range(row, upper ? -kInfinity : 0.0, lower ? kInfinity : 0.0, "r",
                               static_cast<std::int64_t>(index));
    }
    if (!(given.low < given.high)) return {};  // the bounds' own row is refused
    if (sides == kBothSides) {
      problem.add_mixed(row, variable, given.low, given.high);
    } else if (lower) {
      problem.add_pair(row, AffineRow::variable(variable, -given.low));
    } else if (upper) {
      problem.add_pair(row.negated(), AffineRow::variable(variable, -given.high).negated());
    } else {
      return problem.add_range(row, 0.0, 0.0, "r", static_cast<std::int64_t>(index));
    }
    if (lower) plain[at(variable)].low = -kInfinity;
    if (upper) plain[at(variable)].high = kInfinity;
    return {};
  }

  Expected<ProblemFile> assemble(const std::string& name) {
    Assembler problem(header_.variables);
    const Quadratic cost = objective_.times(maximize_ ? -1.0 : 1.0);
    problem.add_constant(cost.constant);
    for (const auto& [index, value] : cost.linear) problem.add_linear(index, value);
    for (const auto& [pair, value] : cost.products) {  // x² is ½ · 2 x², x y is ½ (x y + y x)
      problem.add_quadratic(pair.first, pair.second, pair.first == pair.second ? 2.0 * value : value);
      if (pair.first != pair.second) problem.add_quadratic(pair.second, pair.first, value);
    }
    std::vector<Bounds> plain = bounds_;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const Bounds& bounds = row_bounds_[i];
      const auto added = bounds.complements >= 0
                             ? add_complementarity(problem, i, plain)
                             : problem.add_range(affine(rows_[i]), bounds.low, bounds.high, "r",
                                                 static_cast<std::int64_t>(i));
      if (!added) return unexpected(added.error());
    }
    for (std::size_t i = 0; i < bounds_.size(); ++i) {
      const auto added = problem.add_range(AffineRow::variable(static_cast<Index>(i)), plain[i].low,
                                           plain[i].high, "b", static_cast<std::int64_t>(i));
      if (!added) return unexpected(added.error());
    }
    auto made = problem.finish(name);
    if (!made) return unexpected(made.error());
    ProblemFile file{std::move(*made), std::nullopt};
    if (!initial_.empty()) {
      initial_.resize(file.problem.g.size(), 0.0);
      file.problem.initial_z = initial_;
    }
    return file;
  }

  NlTokens in_;
  const std::size_t most_terms_, length_;
  std::size_t held_ = 0;
  NlHeader header_;
  struct {
    std::int64_t objectives = 0, row_bounds = 0, bounds = 0, jacobian = 0, gradient = 0;
  } seen_;  // of what the header tells
  bool maximize_ = false;
  Quadratic objective_;
  std::vector<Quadratic> rows_;
  std::vector<Bounds> row_bounds_, bounds_;
  std::map<int, Quadratic> defined_;
  std::vector<double> initial_;
  int depth_ = 0;
};

}  // namespace

Expected<ProblemFile> parse_nl(std::string_view content, const std::string& name) {
  return NlReader(content).read(name);
}

}  // namespace marble::formats
