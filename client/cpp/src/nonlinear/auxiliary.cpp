#include "nonlinear/auxiliary.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "nonlinear/sqpcc.h"

namespace marble::nonlinear {

OuterProducts::OuterProducts(const SparseMatrix& upper)
    : columns_(static_cast<std::size_t>(upper.columns)), first_(upper) {
  for (Index j = 0; j < upper.columns; ++j)
    columns_[static_cast<std::size_t>(j)].assign(upper.row_indices.begin() + upper.column_pointers[j],
                                                 upper.row_indices.begin() + upper.column_pointers[j + 1]);
}

void OuterProducts::add(const SparseMatrix& A, const SparseMatrix* B) {
  std::vector<Product> products(static_cast<std::size_t>(A.rows));
  for (Index j = 0; j < A.columns; ++j) {
    for (Index k = A.column_pointers[j]; k < A.column_pointers[j + 1]; ++k)
      products[static_cast<std::size_t>(A.row_indices[k])].entries.push_back({j, k, -1});
    for (Index k = B == nullptr ? 0 : B->column_pointers[j]; B != nullptr && k < B->column_pointers[j + 1];
         ++k) {
      auto& entries = products[static_cast<std::size_t>(B->row_indices[k])].entries;
      if (entries.empty() || entries.back().column != j) entries.push_back({j, -1, -1});
      entries.back().b = k;
    }
  }
  for (const Product& product : products) {
    for (std::size_t q = 0; q < product.entries.size(); ++q)
      for (std::size_t p = 0; p <= q; ++p)
        columns_[static_cast<std::size_t>(product.entries[q].column)].push_back(product.entries[p].column);
  }
  parts_.push_back(std::move(products));
}

void OuterProducts::close() {
  sum_.rows = sum_.columns = static_cast<Index>(columns_.size());
  sum_.column_pointers = {0};
  for (std::vector<Index>& rows : columns_) {
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    sum_.row_indices.insert(sum_.row_indices.end(), rows.begin(), rows.end());
    sum_.column_pointers.push_back(static_cast<Index>(sum_.row_indices.size()));
  }
  columns_ = {};
  sum_.values.assign(sum_.row_indices.size(), 0.0);
  for (Index j = 0; j < first_.columns; ++j)
    for (Index k = first_.column_pointers[j]; k < first_.column_pointers[j + 1]; ++k)
      of_upper_.push_back(position(first_.row_indices[k], j));
  for (auto& products : parts_) {
    for (Product& product : products) {
      for (std::size_t q = 0; q < product.entries.size(); ++q)
        for (std::size_t p = 0; p <= q; ++p)
          product.positions.push_back(position(product.entries[p].column, product.entries[q].column));
    }
  }
}

Index OuterProducts::position(Index row, Index column) const {
  const auto begin = sum_.row_indices.begin();
  return static_cast<Index>(
      std::lower_bound(begin + sum_.column_pointers[column], begin + sum_.column_pointers[column + 1], row) -
      begin);
}

void OuterProducts::begin(const SparseMatrix& upper) {
  std::fill(sum_.values.begin(), sum_.values.end(), 0.0);
  for (std::size_t k = 0; k < of_upper_.size(); ++k) sum_.values[of_upper_[k]] = upper.values[k];
}

void OuterProducts::take(std::size_t part, std::size_t i, const SparseMatrix& A, double alpha,
                         const SparseMatrix* B, double beta, double gamma) {
  if (alpha == 0.0 && beta == 0.0 && gamma == 0.0) return;
  const Product& product = parts_[part][i];
  const auto of = [](const SparseMatrix* M, Index k) { return k < 0 ? 0.0 : M->values[k]; };
  auto at = product.positions.begin();
  for (std::size_t q = 0; q < product.entries.size(); ++q) {
    const Entry& right = product.entries[q];
    const double a = of(&A, right.a), b = of(B, right.b);
    for (std::size_t p = 0; p <= q; ++p, ++at) {
      const Entry& left = product.entries[p];
      const double c = of(&A, left.a), d = of(B, left.b);
      sum_.values[*at] += alpha * a * c + beta * b * d + gamma * (a * d + b * c);
    }
  }
}

Auxiliary::Auxiliary(const Problem& problem, Functions& functions, const Settings& settings, Point first)
    : functions_(functions),
      barrier_(settings.method == Method::barrier),
      kind_(chosen(settings.curvature, problem, first)),
      point_(std::move(first)),
      there_(true) {
  const std::vector<double>* const of[kParts] = {&point_.equalities, &point_.inequalities, &point_.G,
                                                 &point_.H, &point_.G};
  for (std::size_t part = 0; part < kParts; ++part) rows_[part].assign(of[part]->size(), {1.0, 0.0});
  const auto owned = [](std::span<const double> values) { return std::vector(values.begin(), values.end()); };
  made_.start = owned(functions.start()), made_.scale = owned(functions.scale());
  made_.lower = owned(functions.lower()), made_.upper = owned(functions.upper());
  made_.values = [this](std::span<const double> x) { return values(x); };
  made_.derivatives = [this](std::span<const double> x) { return derivatives(x); };
  if (kind_ != Curvature::exact || problem.hessian)
    made_.hessian = [this](std::span<const double> x, const Multipliers& /*none*/) { return hessian(x); };
}

void Auxiliary::set_weight(double mu) {
  for (std::size_t part = 0; part < kParts; ++part)
    for (Row& row : rows_[part])
      row.weight = barrier_ && is_two_sided(static_cast<Part>(part)) ? 1.0 / mu : mu;
}

bool Auxiliary::same(std::span<const double> a, std::span<const double> b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end());
}

const Point& Auxiliary::at(std::span<const double> x) {
  if (there_ && same(point_.x, x)) return point_;
  there_ = false;
  point_.x.assign(x.begin(), x.end());
  if (auto given = functions_.values(point_); !given) throw Refused{std::move(given.error())};
  there_ = true;
  return point_;
}

double Auxiliary::value(Part part, std::size_t i) const {
  switch (part) {
    case equalities:
      return point_.equalities[i];
    case inequalities:
      return point_.inequalities[i];
    case sides_G:
      return point_.G[i];
    case sides_H:
      return point_.H[i];
    default:
      return point_.G[i] * point_.H[i];
  }
}

Auxiliary::Term Auxiliary::term(Part part, std::size_t i) const {
  const double v = value(part, i);
  const auto [mu, pi] = rows_[part][i];
  if (is_two_sided(part)) return {pi * v + mu * v * v, pi + 2.0 * mu * v, 2.0 * mu};
  if (barrier_) return {-mu * std::log(v), mu / v, mu / (v * v)};
  const double estimate = std::max(0.0, pi - 2.0 * mu * v);
  return {(estimate * estimate - pi * pi) / (4.0 * mu), estimate, estimate > 0.0 ? 2.0 * mu : 0.0};
}

double Auxiliary::residual(Part part, std::size_t i) const {
  const double v = value(part, i);
  const auto [mu, pi] = rows_[part][i];
  return std::abs(is_two_sided(part) ? v : std::min(v, pi / (2.0 * mu)));
}

double Auxiliary::barrier() const {
  double sum = 0.0;
  for (const Part part : {inequalities, sides_G, sides_H})
    for (std::size_t i = 0; i < rows_[part].size(); ++i) sum += std::log(value(part, i));
  return sum;
}

double Auxiliary::violation() const {
  return largest_violation({point_.equalities, point_.inequalities, point_.G, point_.H});
}

// Records why the function has no value at the point.
void Auxiliary::find_fault() {
  fault_ = point_.fault;
  if (fault_ || !barrier_) return;
  for (const auto& [part, field] : {std::pair{inequalities, "values.inequalities"},
                                    std::pair{sides_G, "values.G"}, std::pair{sides_H, "values.H"}}) {
    for (std::size_t i = 0; i < rows_[part].size(); ++i) {
      if (value(part, i) > 0.0) continue;
      fault_ = invalid(field, static_cast<std::int64_t>(i), std::to_string(value(part, i)),
                       "must be > 0: the barrier begins inside, and stays there");
      return;
    }
  }
}

Values Auxiliary::values(std::span<const double> x) {
  at(x);
  find_fault();
  if (fault_) return {.objective = std::numeric_limits<double>::quiet_NaN()};
  double sum = point_.objective;
  for (std::size_t part = 0; part < kParts; ++part)
    for (std::size_t i = 0; i < rows_[part].size(); ++i) sum += term(static_cast<Part>(part), i).value;
  return {.objective = sum};
}

void Auxiliary::linearise(std::span<const double> x) {
  at(x);
  if (same(linearised_, x)) return;
  if (auto given = functions_.derivatives(point_, at_); !given) throw Refused{std::move(given.error())};
  linearised_.assign(x.begin(), x.end());
}

void Auxiliary::estimate_multipliers(Multipliers& m) const {
  const auto of = [this](Part part, std::vector<double>& estimates) {
    estimates.resize(rows_[part].size());
    for (std::size_t i = 0; i < estimates.size(); ++i) estimates[i] = estimate(part, i);
  };
  of(equalities, m.equalities), of(inequalities, m.inequalities), of(sides_G, m.G), of(sides_H, m.H);
  for (std::size_t i = 0; i < m.G.size(); ++i) {
    const double product = estimate(products, i);
    m.G[i] -= product * point_.H[i], m.H[i] -= product * point_.G[i];
  }
}

Derivatives Auxiliary::derivatives(std::span<const double> x) {
  linearise(x);
  if (at_.fault) fault_ = at_.fault;
  estimate_multipliers(multipliers_);
  lagrangian_gradient(at_, multipliers_, gradient_);
  if (!at_.fault && !same(seen_[0].x, x)) {
    std::swap(seen_[0], seen_[1]);
    seen_[0].x.assign(x.begin(), x.end());
    seen_[0].objective = point_.objective, seen_[0].violation = violation();
  }
  if (at_.fault) gradient_.assign(gradient_.size(), std::numeric_limits<double>::quiet_NaN());
  return {.gradient = gradient_};
}

// Moves B of the caller's Lagrangian to the point of the linearisation.
void Auxiliary::move_curvature() {
  const std::size_t n = point_.x.size();
  multipliers_.bounds.assign(n, 0.0);
  if (!B_) {
    auto made = Model::create(kind_, functions_, point_, at_, multipliers_);
    if (!made) throw Refused{std::move(made.error())};
    B_ = std::move(*made);
  } else {
    step_.resize(n);
    lagrangian_gradient(at_, multipliers_, change_), lagrangian_gradient(last_, multipliers_, slope_);
    for (std::size_t j = 0; j < n; ++j) step_[j] = point_.x[j] - last_x_[j], change_[j] -= slope_[j];
    if (auto moved = B_->move(functions_, point_, at_, multipliers_, step_, change_); !moved)
      throw Refused{std::move(moved.error())};
  }
  last_x_ = point_.x, last_ = at_;
}

SparseMatrixView Auxiliary::hessian(std::span<const double> x) {
  linearise(x);
  estimate_multipliers(multipliers_);
  move_curvature();
  if (!hessian_) {
    hessian_.emplace(B_->upper());
    hessian_->add(at_.equalities), hessian_->add(at_.inequalities), hessian_->add(at_.G, &at_.H);
    hessian_->close();
  }
  hessian_->begin(B_->upper());
  for (std::size_t i = 0; i < point_.equalities.size(); ++i)
    hessian_->take(0, i, at_.equalities, term(equalities, i).curvature);
  for (std::size_t i = 0; i < point_.inequalities.size(); ++i)
    hessian_->take(1, i, at_.inequalities, term(inequalities, i).curvature);
  for (std::size_t i = 0; i < point_.G.size(); ++i) {
    const double G = point_.G[i], H = point_.H[i];
    const Term product = term(products, i);
    hessian_->take(2, i, at_.G, term(sides_G, i).curvature + product.curvature * H * H, &at_.H,
                   term(sides_H, i).curvature + product.curvature * G * G,
                   product.curvature * G * H + product.estimate);
  }
  return hessian_->sum().view();
}

void Auxiliary::multipliers(std::span<const double> x, double tolerance, Multipliers& m) {
  linearise(x);
  estimate_multipliers(m);
  for (std::size_t i = 0; i < m.inequalities.size(); ++i)
    if (point_.inequalities[i] > tolerance) m.inequalities[i] = 0.0;
  for (std::size_t i = 0; i < m.G.size(); ++i) {
    if (point_.G[i] > tolerance) m.G[i] = 0.0;
    if (point_.H[i] > tolerance) m.H[i] = 0.0;
  }
}

}  // namespace marble::nonlinear
