#include "http/trace_csv.h"

#include <charconv>

namespace marble::server::http {
namespace {

constexpr const char* kHeader =
    "iteration,outer_iteration,objective,equality,inequality,complementarity,kkt_residual,kappa,rho,"
    "step_length,regularization,factorizations,elapsed_seconds\r\n";

template <class Number>
void add(std::string& text, Number value, const char* end = ",") {
  char digits[32];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr).append(end);
}

void add(std::string& text, const v1::Progress& row) {
  add(text, row.iteration());
  add(text, row.outer_iteration());
  add(text, row.objective());
  add(text, row.violations().equality());
  add(text, row.violations().inequality());
  add(text, row.violations().complementarity());
  add(text, row.kkt_residual());
  add(text, row.kappa());
  add(text, row.rho());
  add(text, row.step_length());
  add(text, row.regularization());
  add(text, row.factorizations());
  add(text, row.elapsed_s(), "\r\n");
}

}  // namespace

std::string trace_csv(const v1::Trace& trace) {
  std::string text = kHeader;
  for (const v1::Progress& row : trace.rows()) add(text, row);
  return text;
}

}  // namespace marble::server::http
