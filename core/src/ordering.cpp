// Amestoy, Davis, Duff, "Algorithm 837: AMD, an approximate minimum degree ordering algorithm", 2004, after
// its code in SuiteSparse (AMD_LICENSE), which nothing can interrupt: with the same ties, so the same
// permutation.
#include "ordering.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include "tree.h"

namespace marble {
namespace {

constexpr Index kNone = -1;
constexpr Index kMost = std::numeric_limits<Index>::max();
constexpr double kDense = 10.0;  // rows with more than this times √n entries come last

constexpr Index flip(Index i) { return -i - 2; }

// The quotient graph: a variable's list holds its elements, then its variables; an eliminated pivot is an
// element, whose list holds its variables. Indistinguishable variables are one, with their number as weight.
class QuotientGraph {
 public:
  QuotientGraph(const Pattern& pattern, const Interrupt& interrupt);

  [[nodiscard]] bool eliminate();
  void number(std::vector<Index>& permutation);

 private:
  void fill_lists(const Pattern& pattern);
  void sort_by_degree();
  void take_pivot();
  void form_element();
  void take(Index i);
  void compress(Index e, Index& in_pivot, Index& in_element, Index elements_done, Index entries_left);
  void subtract_element();
  void update_degrees();
  [[nodiscard]] bool merge_alike();
  [[nodiscard]] bool merge_bucket(Index i);
  void close_element();
  void renew_marks();
  void link(Index i, Index degree);
  void give_to_elements();
  void sort_children();
  void postorder();

  Index n_;
  Index capacity_;
  std::unique_ptr<Index[]> memory_;
  // By variable or element.
  Index* start_;     // where its list begins; flip(who took it) once it is part of another; kNone
  Index* length_;    // of its list
  Index* elements_;  // of those, how many are elements; flip(number of rows) of an element
  Index* weight_;    // 0 once merged or eliminated with another; negative in the element being formed
  Index* degree_;
  Index* mark_;  // 0: absorbed
  Index* next_;  // in lists of equal degree, or of equal hash
  Index* last_;
  Index* head_;  // of the list of a degree; flip(head) of a hash, if no degree list is in its place
  Index* lists_;
  Index free_ = 0;  // first unused place of lists_
  Index flag_ = 2, largest_element_ = 0, least_degree_ = 0, eliminated_ = 0;
  // The element being formed: its pivot, weight and degree, its list.
  Index pivot_ = kNone, pivot_weight_ = 0, pivot_degree_ = 0, begin_ = 0, end_ = 0;
  bool in_place_ = false;
  Checkpoint checkpoint_;
};

QuotientGraph::QuotientGraph(const Pattern& pattern, const Interrupt& interrupt)
    : n_(pattern.size()), checkpoint_(interrupt) {
  const auto n = static_cast<std::size_t>(n_);
  const std::size_t entries = 2 * (pattern.rows.size() - n);
  const std::size_t capacity = entries + entries / 5 + n;
  capacity_ = static_cast<Index>(capacity);
  memory_.reset(new Index[9 * n + capacity]);
  Index* place = memory_.get();
  for (Index** array :
       {&start_, &length_, &elements_, &weight_, &degree_, &mark_, &next_, &last_, &head_, &lists_}) {
    *array = place;
    place += n;
  }
  fill_lists(pattern);
  sort_by_degree();
}

void QuotientGraph::fill_lists(const Pattern& pattern) {
  std::fill_n(length_, n_, 0);
  const auto visit = [&pattern, this](auto&& entry) {
    for (Index k = 0; k < n_; ++k) {
      for (Index at = pattern.pointers[k]; at < pattern.pointers[k + 1] - 1; ++at) entry(pattern.rows[at], k);
    }
  };
  visit([this](Index j, Index k) { ++length_[j], ++length_[k]; });
  for (Index j = 0; j < n_; ++j) {
    start_[j] = next_[j] = free_;
    free_ += length_[j];
  }
  visit([this](Index j, Index k) {
    lists_[next_[j]++] = k;
    lists_[next_[k]++] = j;
  });
}

void QuotientGraph::sort_by_degree() {
  const Index dense = std::min(n_, std::max<Index>(16, static_cast<Index>(kDense * std::sqrt(n_))));
  std::fill_n(last_, n_, kNone);
  std::fill_n(head_, n_, kNone);
  std::fill_n(next_, n_, kNone);
  std::fill_n(weight_, n_, 1);
  std::fill_n(mark_, n_, 1);
  std::fill_n(elements_, n_, 0);
  std::copy_n(length_, n_, degree_);
  for (Index i = 0; i < n_; ++i) {
    if (degree_[i] > 0 && degree_[i] <= dense) {
      link(i, degree_[i]);
      continue;
    }
    ++eliminated_;
    start_[i] = kNone;
    if (degree_[i] == 0) {
      elements_[i] = flip(1);
      mark_[i] = 0;
    } else {  // as if it were part of the root
      weight_[i] = 0;
      elements_[i] = kNone;
    }
  }
}

void QuotientGraph::link(Index i, Index degree) {
  const Index next = head_[degree];
  if (next != kNone) last_[next] = i;
  next_[i] = next;
  head_[degree] = i;
}

bool QuotientGraph::eliminate() {
  while (eliminated_ < n_) {
    take_pivot();
    form_element();
    renew_marks();
    subtract_element();
    update_degrees();
    if (!merge_alike()) return false;
    close_element();
  }
  return true;
}

void QuotientGraph::take_pivot() {
  while (head_[least_degree_] == kNone) ++least_degree_;
  pivot_ = head_[least_degree_];
  const Index next = next_[pivot_];
  if (next != kNone) last_[next] = kNone;
  head_[least_degree_] = next;
  pivot_weight_ = weight_[pivot_];
  eliminated_ += pivot_weight_;
  weight_[pivot_] = -pivot_weight_;
  pivot_degree_ = 0;
}

// The element of a pivot: its variables and those of its elements, which it absorbs.
void QuotientGraph::form_element() {
  const Index elements = elements_[pivot_];
  in_place_ = elements == 0;
  if (in_place_) {
    begin_ = end_ = start_[pivot_];
    for (Index p = begin_; p < begin_ + length_[pivot_]; ++p) {
      const Index i = lists_[p];
      if (weight_[i] <= 0) continue;
      lists_[end_++] = i;
      take(i);
    }
  } else {
    Index in_pivot = start_[pivot_];
    const Index variables = length_[pivot_] - elements;
    begin_ = free_;
    for (Index done = 0; done <= elements; ++done) {
      const Index e = done < elements ? lists_[in_pivot++] : pivot_;
      Index in_element = e != pivot_ ? start_[e] : in_pivot;
      for (Index left = e != pivot_ ? length_[e] : variables; left > 0; --left) {
        const Index i = lists_[in_element++];
        if (weight_[i] <= 0) continue;
        if (free_ >= capacity_) compress(e, in_pivot, in_element, done + 1, left - 1);
        lists_[free_++] = i;
        take(i);
      }
      if (e == pivot_) continue;
      start_[e] = flip(pivot_);
      mark_[e] = 0;
    }
    end_ = free_;
  }
  degree_[pivot_] = pivot_degree_;
  start_[pivot_] = begin_;
  length_[pivot_] = end_ - begin_;
  elements_[pivot_] = flip(pivot_weight_ + pivot_degree_);
}

// Into the element being formed, out of its list of equal degree.
void QuotientGraph::take(Index i) {
  pivot_degree_ += weight_[i];
  weight_[i] = -weight_[i];
  const Index last = last_[i];
  const Index next = next_[i];
  if (next != kNone) last_[next] = last;
  (last != kNone ? next_[last] : head_[degree_[i]]) = next;
}

// Moves all lists together, in the middle of forming an element.
void QuotientGraph::compress(Index e, Index& in_pivot, Index& in_element, Index elements_done,
                             Index entries_left) {
  start_[pivot_] = in_pivot;
  length_[pivot_] -= elements_done;
  if (length_[pivot_] == 0) start_[pivot_] = kNone;
  start_[e] = in_element;
  length_[e] = entries_left;
  if (length_[e] == 0) start_[e] = kNone;
  for (Index j = 0; j < n_; ++j) {  // each list's first entry tells whose it is
    if (start_[j] < 0) continue;
    const Index first = start_[j];
    start_[j] = lists_[first];
    lists_[first] = flip(j);
  }
  Index to = 0;
  for (Index from = 0; from < begin_;) {
    const Index j = flip(lists_[from++]);
    if (j < 0) continue;
    lists_[to] = start_[j];
    start_[j] = to++;
    for (Index left = length_[j] - 1; left > 0; --left) lists_[to++] = lists_[from++];
  }
  const Index begin = to;
  for (Index from = begin_; from < free_; ++from) lists_[to++] = lists_[from];
  begin_ = begin;
  free_ = to;
  in_element = start_[e];
  in_pivot = start_[pivot_];
}

void QuotientGraph::renew_marks() {
  if (flag_ < kMost - n_) return;
  for (Index i = 0; i < n_; ++i) mark_[i] = mark_[i] != 0 ? 1 : 0;
  flag_ = 2;
}

// mark − flag becomes the number of rows that each element has outside the new one.
void QuotientGraph::subtract_element() {
  for (Index at = begin_; at < end_; ++at) {
    const Index i = lists_[at];
    const Index weight = -weight_[i];
    for (Index p = start_[i]; p < start_[i] + elements_[i]; ++p) {
      const Index e = lists_[p];
      if (mark_[e] >= flag_) {
        mark_[e] -= weight;
      } else if (mark_[e] != 0) {
        mark_[e] = degree_[e] + flag_ - weight;
      }
    }
  }
}

// Degrees of the new element's variables, without elements that lie within it (aggressive absorption), and
// their hashes. A variable with nothing else is eliminated with the pivot.
void QuotientGraph::update_degrees() {
  for (Index at = begin_; at < end_; ++at) {
    const Index i = lists_[at];
    const Index first = start_[i];
    const Index first_variable = first + elements_[i];
    const Index end = first + length_[i];
    Index to = first;
    Index degree = 0;
    unsigned hash = 0;
    for (Index p = first; p < first_variable; ++p) {
      const Index e = lists_[p];
      if (mark_[e] == 0) continue;
      const Index outside = mark_[e] - flag_;
      if (outside > 0) {
        degree += outside;
        lists_[to++] = e;
        hash += static_cast<unsigned>(e);
      } else {
        start_[e] = flip(pivot_);
        mark_[e] = 0;
      }
    }
    elements_[i] = to - first + 1;
    const Index variables = to;
    for (Index p = first_variable; p < end; ++p) {
      const Index j = lists_[p];
      if (weight_[j] <= 0) continue;
      degree += weight_[j];
      lists_[to++] = j;
      hash += static_cast<unsigned>(j);
    }
    if (elements_[i] == 1 && variables == to) {
      start_[i] = flip(pivot_);
      pivot_degree_ += weight_[i];
      pivot_weight_ -= weight_[i];
      eliminated_ -= weight_[i];
      weight_[i] = 0;
      elements_[i] = kNone;
      continue;
    }
    degree_[i] = std::min(degree_[i], degree);
    lists_[to] = lists_[variables];
    lists_[variables] = lists_[first];
    lists_[first] = pivot_;
    length_[i] = to - first + 1;
    const auto bucket = static_cast<Index>(hash % static_cast<unsigned>(n_));
    const Index head = head_[bucket];
    if (head <= kNone) {
      next_[i] = flip(head);
      head_[bucket] = flip(i);
    } else {  // a list of equal degree begins here: its first variable knows the bucket's
      next_[i] = last_[head];
      last_[head] = i;
    }
    last_[i] = bucket;
  }
  degree_[pivot_] = pivot_degree_;
  largest_element_ = std::max(largest_element_, pivot_degree_);
  flag_ += largest_element_;
  renew_marks();
}

// Variables of the new element with the same lists become one.
bool QuotientGraph::merge_alike() {
  for (Index at = begin_; at < end_; ++at) {
    const Index i = lists_[at];
    if (checkpoint_.reached(1 + length_[i])) return false;
    if (weight_[i] >= 0) continue;
    const Index bucket = last_[i];
    const Index head = head_[bucket];
    Index first = kNone;
    if (head < kNone) {
      first = flip(head);
      head_[bucket] = kNone;
    } else if (head > kNone) {
      first = last_[head];
      last_[head] = kNone;
    }
    if (!merge_bucket(first)) return false;
  }
  return true;
}

bool QuotientGraph::merge_bucket(Index i) {
  for (; i != kNone && next_[i] != kNone; i = next_[i]) {
    const Index length = length_[i];
    for (Index p = start_[i] + 1; p < start_[i] + length; ++p) mark_[lists_[p]] = flag_;
    Index before = i;
    for (Index j = next_[i]; j != kNone; j = next_[j]) {
      bool alike = length_[j] == length && elements_[j] == elements_[i];
      const Index* const list = lists_ + start_[j];
      Index p = 1;
      for (; alike && p < length; ++p) alike = mark_[list[p]] == flag_;
      if (checkpoint_.reached(p)) return false;
      if (!alike) {
        before = j;
        continue;
      }
      start_[j] = flip(i);
      weight_[i] += weight_[j];
      weight_[j] = 0;
      elements_[j] = kNone;
      next_[before] = next_[j];
    }
    ++flag_;
  }
  return true;
}

// Its remaining variables go back to the lists of equal degree.
void QuotientGraph::close_element() {
  Index to = begin_;
  const Index left = n_ - eliminated_;
  for (Index at = begin_; at < end_; ++at) {
    const Index i = lists_[at];
    const Index weight = -weight_[i];
    if (weight <= 0) continue;
    weight_[i] = weight;
    const Index degree = std::min(degree_[i] + pivot_degree_ - weight, left - weight);
    link(i, degree);
    last_[i] = kNone;
    least_degree_ = std::min(least_degree_, degree);
    degree_[i] = degree;
    lists_[to++] = i;
  }
  weight_[pivot_] = pivot_weight_;
  length_[pivot_] = to - begin_;
  if (to == begin_) {
    start_[pivot_] = kNone;
    mark_[pivot_] = 0;
  }
  if (!in_place_) free_ = to;
}

// From here on start_ holds parents in the assembly tree, elements_ the number of rows of an element.
void QuotientGraph::number(std::vector<Index>& permutation) {
  for (Index i = 0; i < n_; ++i) start_[i] = flip(start_[i]);
  for (Index i = 0; i < n_; ++i) elements_[i] = flip(elements_[i]);
  give_to_elements();
  sort_children();
  postorder();
  // mark_: the order of the elements. Their variables follow one another, each before its element.
  std::fill_n(head_, n_, kNone);
  std::fill_n(next_, n_, kNone);
  for (Index e = 0; e < n_; ++e) {
    if (mark_[e] != kNone) head_[mark_[e]] = e;
  }
  Index count = 0;
  for (Index k = 0; k < n_ && head_[k] != kNone; ++k) {
    next_[head_[k]] = count;
    count += weight_[head_[k]];
  }
  for (Index i = 0; i < n_; ++i) {
    if (weight_[i] == 0) next_[i] = start_[i] != kNone ? next_[start_[i]]++ : count++;
  }
  permutation.resize(static_cast<std::size_t>(n_));
  for (Index i = 0; i < n_; ++i) permutation[static_cast<std::size_t>(next_[i])] = i;
}

// A variable that became part of others belongs to the element in which they ended.
void QuotientGraph::give_to_elements() {
  for (Index i = 0; i < n_; ++i) {
    if (weight_[i] != 0 || start_[i] == kNone) continue;
    Index element = start_[i];
    while (weight_[element] == 0) element = start_[element];
    for (Index j = i; weight_[j] == 0;) {
      const Index parent = start_[j];
      start_[j] = element;
      j = parent;
    }
  }
}

// Children by number, but the one with most rows last.
void QuotientGraph::sort_children() {
  Index* const child = head_;
  Index* const sibling = next_;
  std::fill_n(child, n_, kNone);
  std::fill_n(sibling, n_, kNone);
  for (Index j = n_ - 1; j >= 0; --j) {
    const Index parent = start_[j];
    if (weight_[j] <= 0 || parent == kNone) continue;
    sibling[j] = child[parent];
    child[parent] = j;
  }
  for (Index i = 0; i < n_; ++i) {
    if (weight_[i] <= 0 || child[i] == kNone) continue;
    Index last = kNone;
    Index largest = kNone;
    Index before_largest = kNone;
    for (Index f = child[i]; f != kNone; f = sibling[f]) {
      if (largest == kNone || elements_[f] >= elements_[largest]) {
        before_largest = last;
        largest = f;
      }
      last = f;
    }
    if (sibling[largest] == kNone) continue;
    (before_largest == kNone ? child[i] : sibling[before_largest]) = sibling[largest];
    sibling[largest] = kNone;
    sibling[last] = largest;
  }
}

void QuotientGraph::postorder() {
  std::fill_n(mark_, n_, kNone);
  Index count = 0;
  for (Index root = 0; root < n_; ++root) {
    if (start_[root] != kNone || weight_[root] <= 0) continue;
    visit_postorder(root, head_, next_, last_, [&](Index e) { mark_[e] = count++; });
  }
}

}  // namespace

bool order(const Pattern& pattern, const Interrupt& interrupt, std::vector<Index>& permutation) {
  permutation.resize(static_cast<std::size_t>(pattern.size()));
  std::iota(permutation.begin(), permutation.end(), 0);
  // As amd_order does, where its lists would not fit.
  if (permutation.empty() || pattern.rows.size() >= static_cast<std::size_t>(kMost) / sizeof(Index))
    return true;
  QuotientGraph graph(pattern, interrupt);
  if (!graph.eliminate()) return false;
  graph.number(permutation);
  return true;
}

}  // namespace marble
