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

// The entries that are not zero, of which `uses` is true.
void append_sparse(std::string& text, const char* name, const std::vector<double>& values, auto&& uses) {
  std::vector<Index> indices;
  std::vector<double> entries;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] == 0.0 || !uses(i)) continue;
    indices.push_back(static_cast<Index>(i));
    entries.push_back(values[i]);
  }
  if (entries.empty()) return;
  text.append(",\"").append(name).append("\":{\"i\":");
  append(text, indices);
  text += ",\"v\":";
  append(text, entries);
  text += '}';
}

// Which variables are in Q.
std::vector<bool> curved(const SparseMatrixView& Q) {
  std::vector<bool> result(static_cast<std::size_t>(Q.columns), false);
  for (Index column = 0; column < Q.columns; ++column) {
    for (Index k = Q.column_pointers[column]; k < Q.column_pointers[column + 1]; ++k)
      result[static_cast<std::size_t>(column)] = result[static_cast<std::size_t>(Q.row_indices[k])] = true;
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
    add("gap_tolerance", options.gap_tolerance);
    add("equality_tolerance", options.equality_tolerance);
    add("inequality_tolerance", options.inequality_tolerance);
    add("complementarity_tolerance", options.complementarity_tolerance);
    add("point", solution.z);
  }
  write(line += "}\n");
  const std::vector<bool> in_cost = curved(problem.Q);
  const auto all = [](std::size_t) { return true; };
  for (const ProofLeaf& leaf : proof.leaves) {
    line = R"({"s":)";
    append(line, leaf.s_zero);
    add("t", leaf.t_zero);
    line += leaf.contradiction ? R"(,"proves":"contradiction")" : R"(,"proves":"bound")";
    append_sparse(line, "z", leaf.z, [&](std::size_t j) { return j < in_cost.size() && in_cost[j]; });
    append_sparse(line, "y", leaf.y, all);
    append_sparse(line, "nu", leaf.nu, all);
    append_sparse(line, "xi", leaf.xi, all);
    append_sparse(line, "eta", leaf.eta, all);
    write(line += "}\n");
  }
  write("{\"end\":" + std::to_string(proof.leaves.size()) + "}\n");
}

}  // namespace marble
