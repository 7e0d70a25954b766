#include "horizon/stages.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>

#include "model/tuning.h"

namespace marble {
namespace {

// A hypergraph: its edges are the rows, the pairs and the off-diagonal entries of Q, with the variables of
// each.
class Graph {
 public:
  explicit Graph(const ScaledProblem& p);

  [[nodiscard]] Index variables() const { return static_cast<Index>(first_edge_.size()) - 1; }
  [[nodiscard]] std::int64_t entries() const { return std::ssize(vertices_); }
  [[nodiscard]] Index edges() const { return static_cast<Index>(first_vertex_.size()) - 1; }
  /// Returns the variables of an edge.
  [[nodiscard]] std::span<const Index> of_edge(Index edge) const {
    return part(vertices_, first_vertex_, edge);
  }
  [[nodiscard]] std::span<const Index> of_variable(Index variable) const {
    return part(edges_, first_edge_, variable);
  }

 private:
  [[nodiscard]] static std::span<const Index> part(const std::vector<Index>& all,
                                                   const std::vector<Index>& first, Index i) {
    const auto begin = static_cast<std::size_t>(first[i]);
    return std::span(all).subspan(begin, static_cast<std::size_t>(first[i + 1]) - begin);
  }
  void add(const RowMatrix& matrix, Index row) {
    vertices_.insert(vertices_.end(), matrix.column_indices.begin() + matrix.row_pointers[row],
                     matrix.column_indices.begin() + matrix.row_pointers[row + 1]);
  }
  void close_edge() { first_vertex_.push_back(static_cast<Index>(vertices_.size())); }

  std::vector<Index> first_vertex_{0}, vertices_, first_edge_, edges_;
};

// Adds the equalities first.
Graph::Graph(const ScaledProblem& p) {
  for (Index row = 0; row < p.equalities(); ++row) add(p.A, row), close_edge();
  for (Index row = 0; row < p.inequalities(); ++row) add(p.rows, row), close_edge();
  for (Index pair = 0; pair < p.pairs(); ++pair)
    add(p.rows, p.layout.s(pair)), add(p.rows, p.layout.t(pair)), close_edge();
  for (Index j = 0; j < p.Q.size; ++j) {
    for (Index k = p.Q.column_pointers[j]; k < p.Q.column_pointers[j + 1]; ++k) {
      if (p.Q.row_indices[k] == j) continue;
      vertices_.insert(vertices_.end(), {p.Q.row_indices[k], j});
      close_edge();
    }
  }
  first_edge_.assign(static_cast<std::size_t>(p.variables()) + 1, 0);
  for (const Index variable : vertices_) ++first_edge_[variable + 1];
  for (Index j = 0; j < p.variables(); ++j) first_edge_[j + 1] += first_edge_[j];
  edges_.resize(vertices_.size());
  std::vector<Index> next(first_edge_.begin(), first_edge_.end() - 1);
  for (Index edge = 0; edge < edges(); ++edge)
    for (const Index variable : of_edge(edge)) edges_[next[variable]++] = edge;
}

// Distances within a connected component of the graph.
class Distances {
 public:
  explicit Distances(const Graph& graph)
      : graph_(graph),
        of_(static_cast<std::size_t>(graph.variables())),
        seen_(of_.size(), 0),
        seen_edge_(static_cast<std::size_t>(graph.edges()), 0) {}

  /// Measures from a variable to all that can be reached. Returns false if interrupted.
  [[nodiscard]] bool measure(Index from, Checkpoint& checkpoint) {
    ++round_;
    reached_.assign(1, from);
    of_[from] = 0;
    seen_[from] = round_;
    for (std::size_t i = 0; i < reached_.size(); ++i) {
      const Index j = reached_[i];
      if (checkpoint.reached(std::ssize(graph_.of_variable(j)))) return false;
      for (const Index edge : graph_.of_variable(j)) {
        if (std::exchange(seen_edge_[edge], round_) == round_) continue;
        for (const Index other : graph_.of_edge(edge)) {
          if (std::exchange(seen_[other], round_) == round_) continue;
          of_[other] = of_[j] + 1;
          reached_.push_back(other);
        }
      }
    }
    return true;
  }
  [[nodiscard]] Index of(Index variable) const { return of_[variable]; }
  /// Returns the reached variables, nearest first.
  [[nodiscard]] const std::vector<Index>& reached() const { return reached_; }
  [[nodiscard]] Index farthest() const { return reached_.back(); }
  [[nodiscard]] Index length() const { return of_[farthest()]; }

 private:
  const Graph& graph_;
  std::vector<Index> of_, seen_, seen_edge_, reached_;
  Index round_ = 0;
};

// Numbers the component of a variable, from one end to the other. Returns false if interrupted.
bool number(Distances& distances, Index variable, Checkpoint& checkpoint, std::vector<Index>& stage) {
  if (!distances.measure(variable, checkpoint)) return false;
  for (Index pass = 0, length = -1; pass < tuning::few_passes && distances.length() > length; ++pass) {
    length = distances.length();
    if (!distances.measure(distances.farthest(), checkpoint)) return false;
  }
  for (const Index j : distances.reached()) stage[j] = distances.of(j);
  if (!distances.measure(distances.farthest(), checkpoint)) return false;
  Index least = std::numeric_limits<Index>::max();
  for (const Index j : distances.reached()) least = std::min(least, stage[j] -= distances.of(j));
  for (const Index j : distances.reached()) stage[j] = (stage[j] - least) / 2;
  return true;
}

double mean(std::span<const Index> of, const std::vector<double>& values) {
  double sum = 0.0;
  for (const Index i : of) sum += values[i];
  return sum / static_cast<double>(of.size());
}

// A connected component.
struct Part {
  double first = std::numeric_limits<double>::infinity(), last = -first;  // places
  double variables = 0.0, equalities = 0.0;                               // their numbers
  double sum_of_variables = 0.0, sum_of_equalities = 0.0;                 // of their places
};

// Moves each variable to the mean of the rows, pairs and entries of Q that it is in, so that coupled
// variables move together.
std::vector<double> smoothed(const Graph& graph, const std::vector<Index>& stage, Checkpoint& checkpoint) {
  std::vector<double> place(stage.begin(), stage.end()), center(static_cast<std::size_t>(graph.edges()));
  for (int round = 0; round < tuning::stage_smoothing; ++round) {
    if (checkpoint.reached(graph.entries())) break;
    for (Index edge = 0; edge < graph.edges(); ++edge)
      if (!graph.of_edge(edge).empty()) center[edge] = mean(graph.of_edge(edge), place);
    for (Index j = 0; j < graph.variables(); ++j)
      if (!graph.of_variable(j).empty()) place[j] = mean(graph.of_variable(j), center);
  }
  return place;
}

// Shifts places to begin at 0, at the end of each component where its equalities lie more than its variables:
// that end has the equalities that give a state.
void turn(const Graph& graph, Index equalities, const std::vector<Index>& part_of, std::vector<Part>& parts,
          std::vector<double>& place) {
  for (Index j = 0; j < graph.variables(); ++j) {
    Part& part = parts[part_of[j]];
    part.first = std::min(part.first, place[j]), part.last = std::max(part.last, place[j]);
    part.variables += 1.0, part.sum_of_variables += place[j];
  }
  for (Index row = 0; row < equalities; ++row) {
    if (graph.of_edge(row).empty()) continue;
    Part& part = parts[part_of[graph.of_edge(row).front()]];
    part.equalities += 1.0, part.sum_of_equalities += mean(graph.of_edge(row), place);
  }
  for (Index j = 0; j < graph.variables(); ++j) {
    const Part& part = parts[part_of[j]];
    const bool late = part.sum_of_equalities * part.variables > part.sum_of_variables * part.equalities;
    place[j] = late ? part.last - place[j] : place[j] - part.first;
  }
}

}  // namespace

std::optional<Stages> find_stages(const ScaledProblem& problem, const Interrupt& interrupt) {
  const Graph graph(problem);
  const Index n = graph.variables();
  Checkpoint checkpoint(interrupt);
  Distances distances(graph);
  std::vector<Part> parts;
  std::vector<Index> part_of(static_cast<std::size_t>(n), -1), stage(static_cast<std::size_t>(n), 0), width;
  Index widest = 0;
  for (Index j = 0; j < n; ++j) {
    if (part_of[j] >= 0) continue;
    if (!number(distances, j, checkpoint, stage)) return std::nullopt;
    for (const Index member : distances.reached()) {
      part_of[member] = static_cast<Index>(parts.size());
      width.resize(std::max(width.size(), static_cast<std::size_t>(stage[member]) + 1), 0);
      widest = std::max(widest, ++width[stage[member]]);
    }
    parts.emplace_back();
  }
  if (std::ssize(width) < std::int64_t{tuning::stages_of_widest} * widest) return std::nullopt;
  std::vector<double> place = smoothed(graph, stage, checkpoint);
  turn(graph, problem.equalities(), part_of, parts, place);
  Stages result;
  for (Index j = 0; j < n; ++j) {
    result.of_variable.push_back(static_cast<Index>(place[j]));
    result.count = std::max(result.count, result.of_variable[j] + 1);
  }
  return result;
}

}  // namespace marble
