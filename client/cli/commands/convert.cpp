#include <memory>

#include "base/complaint.h"
#include "base/exit_code.h"
#include "commands/commands.h"
#include "formats.h"

namespace marble::cli {
namespace {

int fails(const std::string& path, const std::string& message) {
  complain(path, message);
  return kBadInput;
}

int convert(const std::string& in, const std::string& out) {
  if (const auto valid = formats::check_writable_format(out); !valid)
    return fails(out, valid.error().message());
  const auto file = formats::read_any_problem(in);
  if (!file) return fails(in, file.error().message());
  if (file->maximize) complain(out, formats::kNegativeOfMaximum);
  std::string left_out;
  if (!file->problem.initial_z.empty() && !formats::keeps_initial_point(out)) left_out = "x0";
  if (file->best_known_objective && !out.ends_with(".json"))
    left_out += (left_out.empty() ? "" : " and ") + std::string("best_known_objective");
  if (!left_out.empty()) {
    const char* verb = left_out.find(" and ") == std::string::npos ? " is" : " are";
    complain(out,
             left_out + verb + " left out: the format has no place for " + (verb[1] == 'i' ? "it" : "them"));
  }
  if (const auto written = formats::write_any_problem(*file, out); !written)
    return fails(out, written.error().message());
  return kAllSolved;
}

}  // namespace

void add_convert(CLI::App& program, int& exit_code) {
  auto in = std::make_shared<std::string>();
  auto out = std::make_shared<std::string>();
  CLI::App* command = program.add_subcommand("convert", "Convert a problem to another file format");
  command
      ->add_option("IN", *in,
                   ".json, .pb or .bin, .npz (NumPy), .mat (MATLAB, LCQPow's names), .nl (AMPL), or a folder "
                   "of Matrix "
                   "Market files; - is standard input, JSON or binary")
      ->required();
  command
      ->add_option(
          "OUT", *out,
          "its extension tells the format: .json, .pb or .bin, .npz, or a folder with a / at its end for "
          "Matrix Market")
      ->required();
  command->footer("x0 has no place in .pb and .bin, best_known_objective in .json alone.");
  command->callback([in, out, &exit_code] { exit_code = convert(*in, *out); });
}

}  // namespace marble::cli
