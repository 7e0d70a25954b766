// What a run has judged, and the answers that its judge refuses. A refused answer ends the program, as
// FUZZ_EXPECT does; where MARBLE_FUZZ_FINDINGS names a folder, its input is saved there and the run goes on.
#pragma once

#include <cstdint>
#include <cstdio>
#include <exception>

namespace marble::fuzz {

/// Counts of one run. Printed now and then, and when the program ends.
struct Tally {
  std::int64_t inputs = 0;
  std::int64_t refused = 0;      ///< requests that ended with an error
  std::int64_t answers = 0;      ///< judged answers
  std::int64_t solved = 0;       ///< of these, solved
  std::int64_t derivatives = 0;  ///< judged directions, losses and row responses
  std::int64_t wrong = 0;        ///< inputs with a refused answer
};
[[nodiscard]] Tally& tally();

/// A refused answer, where the run goes on.
struct Objection : std::exception {
  Objection(const char* in_file, int at_line) : file(in_file), line(at_line) {}
  const char* file;
  int line;
};

void begin_input();
[[noreturn]] void object(const char* file, int line, const char* condition);
void save_finding(const Objection& objection, const std::uint8_t* data, std::size_t size);

/// Runs one input. Returns what LLVMFuzzerTestOneInput does.
template <class Body>
int judged(const std::uint8_t* data, std::size_t size, const Body& body) {
  begin_input();
  try {
    body();
  } catch (const Objection& objection) {
    save_finding(objection, data, size);
  }
  return 0;
}

}  // namespace marble::fuzz

#define FUZZ_JUDGE(condition)                                                 \
  do {                                                                        \
    if (!(condition)) ::marble::fuzz::object(__FILE__, __LINE__, #condition); \
  } while (false)

// As FUZZ_JUDGE(value <= bound), and prints both numbers. NaN is refused.
#define FUZZ_JUDGE_AT_MOST(value, bound)                                                \
  do {                                                                                  \
    const double judged_value = (value), judged_bound = (bound);                        \
    if (!(judged_value <= judged_bound)) {                                              \
      std::fprintf(stderr, "%.17g is not at most %.17g\n", judged_value, judged_bound); \
      ::marble::fuzz::object(__FILE__, __LINE__, #value " <= " #bound);                 \
    }                                                                                   \
  } while (false)
