#include "nl/nl_segments.h"

#include <pthread.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace marble::formats {
namespace {

constexpr int kMany = 0x7fffffff;
constexpr std::size_t kDeepest = 10'000;
constexpr std::size_t kBytesOfLevel = 1024;        // measured: 960 at most, in readers and library
constexpr std::size_t kBytesOfOthers = 96 * 1024;  // for callers and callees of these functions

// Returns the bytes of this thread's stack that are free below this function.
std::size_t free_stack() {
  pthread_attr_t attributes;
  if (pthread_getattr_np(pthread_self(), &attributes) != 0) return 0;
  void* lowest = nullptr;
  std::size_t size = 0;
  pthread_attr_getstack(&attributes, &lowest, &size);
  pthread_attr_destroy(&attributes);
  const auto here = reinterpret_cast<std::uintptr_t>(&attributes),
             end = reinterpret_cast<std::uintptr_t>(lowest);
  return here > end ? here - end : 0;
}

// Returns the most nested nodes: 10,000, or what fits the rest of this thread's stack, if that is less. The
// readers, and AMPL's library when it evaluates, recurse on the stack.
std::size_t deepest_nesting() {
  const std::size_t free = free_stack();
  const std::size_t fitting = free > kBytesOfOthers ? (free - kBytesOfOthers) / kBytesOfLevel : 0;
  return std::min(fitting, kDeepest);
}

// Names of operators that no LCQP has (Gay, table 5).
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

}  // namespace

NlSegments::NlSegments(std::string_view content, const NlNames& names, const char* whole)
    : in_(content), names_(names), length_(content.size()), whole_(whole), deepest_(deepest_nesting()) {}

std::string operator_name(int code) {
  const auto* const found = std::ranges::find(kOthers, code, &NamedOperator::code);
  return found == std::end(kOthers) ? "" : found->name;
}

Expected<void> NlSegments::read_segments() {
  header_ = in_.header();
  check_header();
  if (!in_.failed()) {
    model_.rows.resize(at(header_.constraints));
    model_.row_bounds.resize(model_.rows.size());
    model_.bounds.resize(at(header_.variables));
    while (const char key = in_.key()) {
      segment(key);
      if (in_.failed()) break;
    }
    check_complete();
  }
  if (in_.failed()) return unexpected(place_.named(in_.error(), names_));
  return {};
}

void NlSegments::check_header() {
  const auto refuse = [&](std::int64_t count, const char* what) {
    if (count > 0)
      in_.fail("header", std::to_string(count) + " " + what, std::string("must be none: not ") + whole_);
  };
  const std::int64_t first = header_.first_integer;
  if (header_.integers > 0 && first >= 0 && first < header_.variables)
    enter(Kind::column, static_cast<int>(first));
  refuse(header_.integers, "integer variables");
  refuse(header_.networks, "network constraints");
  refuse(header_.functions, "imported functions");
  refuse(header_.logical_constraints, "logical constraints");
  if (header_.objectives > 1)
    in_.fail("header", std::to_string(header_.objectives) + " objectives", "must be one at most");
  // Every variable and every constraint has a bound of at least one byte.
  if (at(header_.variables) + at(header_.constraints) > length_) {
    in_.fail("header",
             std::to_string(header_.variables) + " variables, " + std::to_string(header_.constraints) +
                 " constraints",
             "must be no more than the file has bytes, " + std::to_string(length_));
  }
}

// A file cut off at a segment's end is still valid, but another problem. (Linear rows need no C.)
void NlSegments::check_complete() {
  const auto need = [&](const char* key, std::int64_t there, std::int64_t reported) {
    if (there >= reported) return;
    in_.fail(key, std::to_string(there) + " of " + std::to_string(reported),
             "is missing: the file ends too soon");
  };
  need("O", seen_.objectives, header_.objectives);
  need("r", seen_.row_bounds, header_.constraints);
  need("b", seen_.bounds, header_.variables);
  need("J", seen_.jacobian, header_.jacobian);
  need("G", seen_.gradient, header_.gradient);
}

void NlSegments::segment(char key) {
  enter(Kind::none);
  switch (key) {
    case 'C':
      return constraint();
    case 'O':
      return objective();
    case 'V':
      return definition();
    case 'J':
      return jacobian_row();
    case 'G':
      static_cast<void>(in_.integer("G", 0, header_.objectives - 1));
      return linear_terms(seen_.gradient, [this](int variable, double coefficient) {
        add_objective_term(variable, coefficient);
      });
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
      return numbers(key, header_.variables, model_.initial);
    case 'd':
      return numbers(key, header_.constraints, model_.duals);
    case 'S':
      return suffix();
    case 'k':
      for (int count = in_.integer("k", 0, kMany); count > 0 && !in_.failed(); --count)
        static_cast<void>(in_.integer("k", 0, kMany));
      return;
    default:
      in_.fail("segment", std::string(1, key), std::string("is none that ") + whole_ + " has");
  }
}

void NlSegments::descend(std::size_t more) {
  ++depth_;
  if (depth_ + more > deepest_) {
    in_.fail("expression", std::to_string(depth_ + more) + " levels",
             "must be nested at most " + std::to_string(deepest_) + " deep");
  }
}

void NlSegments::constraint() {
  const int row = in_.integer("C", 0, header_.constraints - 1);
  enter(Kind::row, row);
  if (!in_.failed()) read_row(row);
}

void NlSegments::objective() {
  static_cast<void>(in_.integer("O", 0, header_.objectives - 1));
  model_.maximize = in_.integer("O", 0, 1) == 1;
  enter(Kind::objective);
  if (!in_.failed()) read_objective();
  ++seen_.objectives;
}

void NlSegments::definition() {
  const int index = in_.integer("V", header_.variables, kMany);
  enter(Kind::definition, index);
  const int count = in_.integer("V", 0, header_.variables);
  static_cast<void>(in_.integer("V", 0, kMany));
  Terms linear;
  for (int i = 0; i < count && !in_.failed(); ++i) {
    const int variable = in_.integer("V", 0, header_.variables - 1);
    linear.emplace_back(variable, in_.real("V"));
  }
  if (!in_.failed()) read_definition(index, std::move(linear));
}

void NlSegments::jacobian_row() {
  const int row = in_.integer("J", 0, header_.constraints - 1);
  enter(Kind::row, row);
  if (in_.failed()) return;
  linear_terms(seen_.jacobian,
               [this, row](int variable, double coefficient) { add_row_term(row, variable, coefficient); });
}

template <class Add>
void NlSegments::linear_terms(std::int64_t& seen, const Add& add) {
  for (int count = in_.integer("J", 0, header_.variables); count > 0 && !in_.failed(); --count) {
    const int variable = in_.integer("J", 0, header_.variables - 1);
    add(variable, in_.real("J"));
    ++seen;
  }
}

NlBounds NlSegments::bound(const char* what, bool may_complement) {
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
  if (bounds.low == bounds.high) return bounds;
  if (bounds.low <= -infinite_limit) bounds.low = -kInfinity;
  if (bounds.high >= infinite_limit) bounds.high = kInfinity;
  return bounds;
}

// Reads the initial point or the dual values; missing values are 0.
void NlSegments::numbers(char key, int size, std::vector<double>& values) {
  const char what[] = {key, '\0'};
  values.assign(at(size), 0.0);
  for (int count = in_.integer(what, 0, size); count > 0 && !in_.failed(); --count) {
    const int index = in_.integer(what, 0, size - 1);
    values[at(index)] = in_.real(what);
  }
}

void NlSegments::skip_pairs(int count) {
  for (; count > 0 && !in_.failed(); --count) {
    static_cast<void>(in_.integer("entry", 0, kMany));
    static_cast<void>(in_.real("entry"));
  }
}

// "S kind count name", then as many pairs; kinds from 4 on have real values, which makes no difference in
// text.
void NlSegments::suffix() {
  const int kind = in_.integer("S", 0, 7);
  int count = in_.integer("S", 0, kMany);
  in_.skip_name();
  if ((kind & 4) != 0 || !header_.binary) return skip_pairs(count);
  for (; count > 0 && !in_.failed(); --count) {
    static_cast<void>(in_.integer("S", 0, kMany));
    static_cast<void>(in_.integer("S", -kMany - 1, kMany));
  }
}

}  // namespace marble::formats
