// Writes .nl files, text and binary, token by token: what AMPL would write, for tests.
#pragma once

#include <cstdint>
#include <cstring>
#include <sstream>
#include <string>

namespace marble::testing {

class NlWriter {
 public:
  /// A problem with these sizes.
  NlWriter(bool binary, int variables, int constraints, int objectives, int integers = 0)
      : binary_(binary),
        variables_(variables),
        constraints_(constraints),
        objectives_(objectives),
        integers_(integers) {}

  NlWriter& key(char c) {
    line();
    content_ += c;
    segment_ = c;
    return *this;
  }
  NlWriter& integer(std::int32_t value) {
    if (binary_) return raw(&value, sizeof value);
    content_ += (content_.back() >= 'A' || value < 0 ? "" : " ") + std::to_string(value);
    return *this;
  }
  NlWriter& real(double value) {
    if (binary_) return raw(&value, sizeof value);
    std::ostringstream text;
    text.precision(17);
    text << value;
    content_ += (content_.ends_with('n') ? "" : " ") + text.str();
    return *this;
  }
  /// One entry "index value" of a segment, on a line of its own.
  NlWriter& entry(int index, double value) {
    line();
    if (segment_ == 'J') ++jacobian_;
    if (segment_ == 'G') ++gradient_;
    return integer(index).real(value);
  }
  NlWriter& constant(double value) { return key('n').real(value); }
  NlWriter& variable(int index) { return key('v').integer(index); }
  NlWriter& operation(int code) { return key('o').integer(code); }
  /// A bound of r or b.
  NlWriter& at_least(double low) { return key('2').real(low); }
  NlWriter& at_most(double high) { return key('1').real(high); }
  NlWriter& between(double low, double high) { return key('0').real(low).real(high); }
  NlWriter& equal(double value) { return key('4').real(value); }
  NlWriter& free() { return key('3'); }
  NlWriter& complements(int sides, int variable) { return key('5').integer(sides).integer(variable + 1); }

  [[nodiscard]] std::string content() {
    line();
    std::ostringstream header;
    header << (binary_ ? "b" : "g") << "3 1 1 0\t# problem test\n"
           << ' ' << variables_ << ' ' << constraints_ << ' ' << objectives_
           << " 0 0\t# vars, constraints, objectives\n"
           << " 0 1 0 0 0 0\t# nonlinear\n 0 0\t# network\n 0 " << variables_ << " 0\t# nonlinear vars\n"
           << " 0 0 " << (binary_ ? 1 : 0) << " 1\t# functions, arithmetic, flags\n"
           << ' ' << integers_ << " 0 0 0 0\t# discrete\n"
           << ' ' << jacobian_ << ' ' << gradient_ << "\t# nonzeros\n 0 0\t# names\n 0 0 0 0 0\t# common\n";
    return header.str() + content_;
  }

  NlWriter& line() {
    if (!binary_ && !content_.empty() && !content_.ends_with('\n')) content_ += '\n';
    return *this;
  }

 private:
  NlWriter& raw(const void* value, std::size_t size) {
    content_.append(static_cast<const char*>(value), size);
    return *this;
  }

  const bool binary_;
  const int variables_, constraints_, objectives_, integers_;
  int jacobian_ = 0, gradient_ = 0;
  char segment_ = '\0';
  std::string content_;
};

}  // namespace marble::testing
