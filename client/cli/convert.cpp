#include <fstream>
#include <iostream>
#include <memory>

#include "commands.h"
#include "exit_code.h"
#include "marble/problem_file.h"

namespace marble::cli {
namespace {

constexpr const char* kNoPlace = "the binary format (message marble.v1.Problem) has no place for them";

int convert(const std::string& in, const std::string& out) {
  const auto format = format_of_path(out);
  if (!format) {
    std::cerr << "marble: " << out << ": " << format.error().message() << '\n';
    return kBadInput;
  }
  const auto file = read_problem(in);
  if (!file) {
    std::cerr << "marble: " << in << ": " << file.error().message() << '\n';
    return kBadInput;
  }
  if (*format == FileFormat::binary && (!file->problem.initial_z.empty() || file->best_known_objective)) {
    std::cerr << "marble: " << out << ": x0 and best_known_objective are left out: " << kNoPlace << '\n';
  }
  std::ofstream stream(out, std::ios::binary);
  stream << write_problem(*file, *format);
  stream.close();
  if (!stream) {
    std::cerr << "marble: " << out << ": cannot be written\n";
    return kBadInput;
  }
  return kAllSolved;
}

}  // namespace

void add_convert(CLI::App& program, int& exit_code) {
  auto in = std::make_shared<std::string>();
  auto out = std::make_shared<std::string>();
  CLI::App* command = program.add_subcommand("convert", "Rewrite a problem in the other format");
  command->add_option("IN", *in, ".json, .pb or .bin; - is standard input")->required();
  command->add_option("OUT", *out, "its extension tells the format: .json, or .pb and .bin for binary")
      ->required();
  command->footer(std::string("x0 and best_known_objective: ") + kNoPlace + ".");
  command->callback([in, out, &exit_code] { exit_code = convert(*in, *out); });
}

}  // namespace marble::cli
