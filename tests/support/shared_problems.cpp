#include "support/shared_problems.h"

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

namespace marble::testing {
namespace {

SparseMatrix matrix(const nlohmann::json& json, const char* name) {
  const Triplets entries{json["i"], json["j"], json["v"]};
  return compress(json["rows"], json["cols"], entries, name).value();
}

}  // namespace

std::filesystem::path shared_benchmarks() {
  const char* shared = std::getenv("MARBLE_SHARED");
  const std::filesystem::path folder = shared != nullptr
                                           ? std::filesystem::path(shared)
                                           : std::filesystem::path(MARBLE_SOURCE_DIR) / ".." / "shared";
  return folder / "benchmarks";
}

SharedProblem read_shared(const std::filesystem::path& file) {
  std::ifstream stream(file);
  const nlohmann::json json = nlohmann::json::parse(stream);
  SharedProblem out;
  out.best_known_objective = json["best_known_objective"];
  OwnedProblem& p = out.problem;
  p.name = json["name"];
  p.c0 = json["c0"];
  for (const auto& [key, vector] : {std::pair{"g", &p.g}, {"b", &p.b}, {"d", &p.d}, {"l", &p.l}, {"r", &p.r}})
    *vector = json[key].get<std::vector<double>>();
  for (const auto& [key, part] : {std::pair{"Q", &p.Q}, {"A", &p.A}, {"C", &p.C}, {"L", &p.L}, {"R", &p.R}})
    *part = matrix(json[key], key);
  return out;
}

}  // namespace marble::testing
