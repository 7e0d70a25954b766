#include "marble/json_proof.h"

#include <charconv>
#include <cmath>
#include <string>

namespace marble {
namespace {

void append(std::string& text, double value) {
  if (!std::isfinite(value)) {
    text += "null";
    return;
  }
  char digits[32];
  text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

void append(std::string& text, Index value) { text += std::to_string(value); }

void append(std::string& text, const auto& values) {
  char before = '[';
  for (const auto& value : values) {
    text += before;
    append(text, value);
    before = ',';
  }
  text += before == '[' ? "[]" : "]";
}

void append_sparse(std::string& text, const char* name, const SparseNumbers& numbers) {
  if (numbers.values.empty()) return;
  text.append(",\"").append(name).append("\":{\"i\":");
  append(text, numbers.indices);
  text += ",\"v\":";
  append(text, numbers.values);
  text += '}';
}

// Returns which variables occur in Q.
std::vector<bool> curved(const SparseMatrixView& Q, std::size_t variables) {
  std::vector<bool> result(variables, false);
  for (Index column = 0; column < Q.columns; ++column) {
    for (Index k = Q.column_pointers[column]; k < Q.column_pointers[column + 1]; ++k)
      result[static_cast<std::size_t>(column)] = result[static_cast<std::size_t>(Q.row_indices[k])] = true;
  }
  return result;
}

SparseNumbers only(const SparseNumbers& numbers, const std::vector<bool>& these) {
  SparseNumbers result;
  for (std::size_t k = 0; k < numbers.indices.size(); ++k) {
    if (!these[static_cast<std::size_t>(numbers.indices[k])]) continue;
    result.indices.push_back(numbers.indices[k]);
    result.values.push_back(numbers.values[k]);
  }
  return result;
}

}  // namespace

void write_proof(const Proof& proof, const ProblemView& problem, const Options& options,
                 const Solution& solution, const std::function<void(std::string_view)>& write) {
  const bool infeasible = proof.claim == Proof::Claim::infeasible;
  std::string line = R"({"format":"marble-proof","version":1,"n":)";
  append(line, static_cast<Index>(problem.g.size()));
  const auto add = [&line](const char* key, const auto& value) {
    line.append(",\"").append(key).append("\":");
    append(line, value);
  };
  add("equalities", static_cast<Index>(problem.b.size()));
  add("inequalities", static_cast<Index>(problem.d.size()));
  add("pairs", static_cast<Index>(problem.l.size()));
  line += infeasible ? R"(,"claim":"infeasible")" : R"(,"claim":"bound")";
  add("bound", proof.bound);
  add("radius", proof.radius);
  add("leaves", static_cast<Index>(proof.leaves.size()));
  if (is_solved(solution.status)) {
    add("objective", solution.objective);
    add("relative_gap_tolerance", options.relative_gap_tolerance);
    add("equality_tolerance", options.equality_tolerance);
    add("inequality_tolerance", options.inequality_tolerance);
    add("complementarity_tolerance", options.complementarity_tolerance);
    add("point", solution.z);
  }
  write(line += "}\n");
  const std::vector<bool> in_cost = curved(problem.Q, problem.g.size());
  for (const ProofLeaf& leaf : proof.leaves) {
    line = R"({"s":)";
    append(line, leaf.s_zero);
    add("t", leaf.t_zero);
    line += leaf.contradiction ? R"(,"proves":"contradiction")" : R"(,"proves":"bound")";
    append_sparse(line, "z", only(leaf.z, in_cost));
    append_sparse(line, "y", leaf.y);
    append_sparse(line, "nu", leaf.nu);
    append_sparse(line, "xi", leaf.xi);
    append_sparse(line, "eta", leaf.eta);
    write(line += "}\n");
  }
  write("{\"end\":" + std::to_string(proof.leaves.size()) + "}\n");
}

}  // namespace marble
