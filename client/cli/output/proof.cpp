#include "output/proof.h"

#include <cmath>

#include "output/text_table.h"

namespace marble::cli {

std::string whole_text(std::int64_t count) {
  std::string text = std::to_string(count);
  for (auto at = static_cast<int>(text.size()) - 3; at > 0; at -= 3)
    text.insert(static_cast<std::size_t>(at), 1, ',');
  return text;
}

std::string proof_text(const Proof& proof) {
  if (proof.nodes == 0) return "";
  const std::string nodes = whole_text(proof.nodes) + (proof.nodes == 1 ? " node" : " nodes");
  if (proof.proved && proof.status == Status::infeasible) return "proved infeasible: " + nodes;
  if (proof.proved && proof.status == Status::unbounded) return "proved unbounded: " + nodes;
  const std::string gap = std::isfinite(proof.gap) ? formatted("gap %.1e, ", proof.gap) : "";
  if (proof.proved) return "proved optimal: " + gap + nodes;
  const std::string bound =
      std::isfinite(proof.bound) ? formatted("bound %.10g, ", proof.bound) : "no bound, ";
  return "not proved" + std::string(proof.status ? ": " : " yet: ") + bound + gap + nodes + ", " +
         whole_text(proof.open_nodes) + " open";
}

std::optional<double> nodes_per_s(std::span<const Progress> rows) {
  if (rows.empty() || rows.back().nodes == 0) return {};
  const Progress& newest = rows.back();
  const Progress* from = &newest;
  for (const Progress& row : rows) {
    if (from != &newest && row.elapsed_s > 0.9 * newest.elapsed_s) break;
    from = &row;
  }
  const double seconds = newest.elapsed_s - from->elapsed_s;
  if (!(seconds > 0.0)) return {};
  return static_cast<double>(newest.nodes - from->nodes) / seconds;
}

}  // namespace marble::cli
