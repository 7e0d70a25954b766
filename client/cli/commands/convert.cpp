#include <fstream>
#include <memory>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "formats.h"
#include "output/problem_names.h"

namespace marble::cli {
namespace {

int fails(const std::string& path, const std::string& message) {
  complain(path, message);
  return kBadInput;
}

bool is_json(const std::string& path) {
  const auto format = format_of_path(path);
  return format && *format == FileFormat::json;
}

// What the file has and the format of `out` has no place for: "x0 and names".
std::string left_out(const NamedProblem& named, const std::string& out) {
  const bool json = is_json(out);
  std::string parts;
  const auto add = [&parts](bool lost, const char* part) {
    if (lost) parts += (parts.empty() ? "" : " and ") + std::string(part);
  };
  add(!named.file.problem.initial_z.empty() && !formats::keeps_initial_point(out), "x0");
  add(named.file.best_known_objective && !json, "best_known_objective");
  add(!named.names.empty() && !json, "names");
  return parts;
}

Expected<void> write(const NamedProblem& named, const std::string& out) {
  if (!is_json(out)) return formats::write_any_problem(named.file, out);
  std::ofstream stream(out, std::ios::binary);
  stream << with_names(write_problem(named.file, FileFormat::json), named.names);
  stream.close();
  if (stream) return {};
  return unexpected(failure(ErrorCode::unavailable, "cannot be written"));
}

int convert(const std::string& in, const std::string& out) {
  if (const auto valid = formats::check_writable_format(out); !valid)
    return fails(out, valid.error().message());
  const auto named = read_named_problem(in);
  if (!named) return fails(in, named.error().message());
  if (named->file.maximize) complain(out, formats::kNegativeOfMaximum);
  if (const std::string parts = left_out(*named, out); !parts.empty())
    complain(out, "has no place for " + parts + ": left out");
  if (const auto written = write(*named, out); !written) return fails(out, written.error().message());
  return kAllSolved;
}

}  // namespace

void add_convert(CLI::App& program, int& exit_code) {
  auto in = std::make_shared<std::string>();
  auto out = std::make_shared<std::string>();
  CLI::App* command = program.add_subcommand("convert", "Convert a problem to another file format");
  command
      ->add_option("IN", *in,
                   ".json, .pb or .bin, .npz (NumPy), .nl (AMPL), or a folder of Matrix Market files; - is "
                   "standard input, JSON or binary")
      ->required();
  command
      ->add_option(
          "OUT", *out,
          "its extension names the format: .json, .pb or .bin, .npz, or a folder with a / at its end for "
          "Matrix Market")
      ->required();
  command->footer(
      "x0 has no place in .pb and .bin. Only .json holds best_known_objective and names. MATLAB's files are "
      "converted by: python3 -m marble convert problem.mat problem.json");
  command->callback([in, out, &exit_code] { exit_code = convert(*in, *out); });
}

}  // namespace marble::cli
