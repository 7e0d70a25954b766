#include "requests/findings.h"

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>

namespace marble::fuzz {
namespace {

constexpr int kSavedOfPlace = 5;
constexpr std::int64_t kPrintedEvery = 10000;

const char* folder() {
  static const char* const name = std::getenv("MARBLE_FUZZ_FINDINGS");
  return name;
}

void print_tally() {
  const Tally& t = tally();
  std::fprintf(stderr,
               "judged: %lld inputs, %lld refused, %lld answers, %lld solved, %lld derivatives, %lld wrong\n",
               static_cast<long long>(t.inputs), static_cast<long long>(t.refused),
               static_cast<long long>(t.answers), static_cast<long long>(t.solved),
               static_cast<long long>(t.derivatives), static_cast<long long>(t.wrong));
}

}  // namespace

Tally& tally() {
  static Tally counts;
  static const bool registered = std::atexit(print_tally) == 0;
  (void)registered;
  return counts;
}

void begin_input() {
  if (++tally().inputs % kPrintedEvery == 0) print_tally();
}

void object(const char* file, int line, const char* condition) {
  std::fprintf(stderr, "%s:%d: not so: %s\n", file, line, condition);
  if (folder() != nullptr) throw Objection(file, line);
  std::abort();
}

void save_finding(const Objection& objection, const std::uint8_t* data, std::size_t size) {
  ++tally().wrong;
  static std::map<std::string, int> saved;
  const std::string place =
      std::filesystem::path(objection.file).stem().string() + "-" + std::to_string(objection.line);
  const int count = ++saved[place];
  if (count > kSavedOfPlace) return;
  const auto path = std::filesystem::path(folder()) / (place + "-" + std::to_string(count));
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
}

}  // namespace marble::fuzz
