#include "nl/nl_model.h"

#include <algorithm>
#include <utility>

namespace marble::formats {
namespace {

class Assembly {
 public:
  Assembly(NlModel model, const NlNames& names)
      : model_(std::move(model)), names_(names), parts_(static_cast<Index>(model_.bounds.size())) {}

  Expected<NlProblem> assemble(const std::string& name) {
    const Quadratic cost = model_.objective.times(model_.maximize ? -1.0 : 1.0);
    parts_.add_constant(cost.constant);
    for (const auto& [index, value] : cost.linear) parts_.add_linear(index, value);
    for (const auto& [pair, value] : cost.products) {  // x² is ½ · 2 x², x y is ½ (x y + y x)
      parts_.add_quadratic(pair.first, pair.second, pair.first == pair.second ? 2.0 * value : value);
      if (pair.first != pair.second) parts_.add_quadratic(pair.second, pair.first, value);
    }
    MARBLE_RETURN_IF_ERROR(add_rows());
    MARBLE_ASSIGN_OR_RETURN(made_.file.problem, parts_.finish(name));
    made_.file.maximize = model_.maximize;
    made_.initial_duals = std::move(model_.duals);
    take_initial_point();
    return std::move(made_);
  }

 private:
  static std::size_t at(int index) { return static_cast<std::size_t>(index); }

  Error of(Error error, NlPlace::Kind kind, std::size_t index) const {
    return NlPlace{kind, static_cast<int>(index)}.named(std::move(error), names_);
  }

  static AffineRow affine(const Quadratic& row) {
    AffineRow result;
    result.constant = row.constant;
    result.terms.assign(row.linear.begin(), row.linear.end());
    return result;
  }

  // "5 k i". AMPL's own readers take the row's bounds from k alone (ASL's fg_read.c: lower k & 2 ? -inf : 0,
  // upper k & 1 ? inf : 0). Any other bound of the variable is a plain bound: Pyomo writes k = 1 for a
  // variable with two bounds. `plain_` has the bounds that no pair imposes.
  Expected<void> add_complementarity(std::size_t index) {
    const int variable = model_.row_bounds[index].complements, sides = model_.row_bounds[index].sides;
    const auto row_number = static_cast<Index>(index);
    const AffineRow row = affine(model_.rows[index]);
    const NlBounds& given = model_.bounds[at(variable)];
    const bool lower = (sides & kLowerSide) != 0, upper = (sides & kUpperSide) != 0;
    const auto refuse = [&](const char* rule) {
      return unexpected(invalid("r", static_cast<std::int64_t>(index),
                                "5 " + std::to_string(sides) + " " + std::to_string(variable + 1), rule));
    };
    if (lower && given.low == -kInfinity) return refuse("must complement a variable with a lower bound");
    if (upper && given.high == kInfinity) return refuse("must complement a variable with an upper bound");
    if (sides == 0 && (given.low > -kInfinity || given.high < kInfinity))
      return refuse("must complement a variable without bounds");
    if (given.low == given.high) {  // the variable is fixed: the sides alone restrict its row
      if (sides == kBothSides) return {};
      return add_row(row, upper ? -kInfinity : 0.0, lower ? kInfinity : 0.0, row_number);
    }
    if (!(given.low < given.high)) return {};  // the bounds' own row is rejected
    const Index pair = parts_.pairs();
    if (sides == kBothSides) {
      made_.row_duals.push_back({row_number, Block::equality, parts_.equalities(), -1.0});
      parts_.add_mixed(row, variable, given.low, given.high);
      mixed_.push_back(row_number);
      made_.reduced_costs.push_back({variable, Block::right, pair, 1.0});
      made_.reduced_costs.push_back({variable, Block::right, pair + 1, -1.0});
    } else if (lower) {
      parts_.add_pair(row, AffineRow::variable(variable, -given.low));
      made_.row_duals.push_back({row_number, Block::left, pair, 1.0});
      made_.reduced_costs.push_back({variable, Block::right, pair, 1.0});
    } else if (upper) {
      parts_.add_pair(row.negated(), AffineRow::variable(variable, -given.high).negated());
      made_.row_duals.push_back({row_number, Block::left, pair, -1.0});
      made_.reduced_costs.push_back({variable, Block::right, pair, -1.0});
    } else {
      return add_row(row, 0.0, 0.0, row_number);
    }
    if (lower) plain_[at(variable)].low = -kInfinity;
    if (upper) plain_[at(variable)].high = kInfinity;
    return {};
  }

  // As add_range, and relies on its order of rows; appends the terms of the dual value to `duals`.
  Expected<void> add_bounded(const AffineRow& row, double low, double high, const char* field, Index index,
                             std::vector<DualTerm>& duals) {
    const Index equality = parts_.equalities();
    Index inequality = parts_.inequalities();
    auto added = parts_.add_range(row, low, high, field, index);
    if (!added) return added;
    if (parts_.equalities() > equality) {
      duals.push_back({index, Block::equality, equality, -1.0});
      return added;
    }
    if (low > -kInfinity) duals.push_back({index, Block::inequality, inequality++, 1.0});
    if (high < kInfinity) duals.push_back({index, Block::inequality, inequality, -1.0});
    return added;
  }
  Expected<void> add_row(const AffineRow& row, double low, double high, Index index) {
    return add_bounded(row, low, high, "r", index, made_.row_duals);
  }

  // Rejects by the same rule as rows of these bounds would be.
  Expected<void> keep_bounds(Index index, const NlBounds& bounds) {
    made_.bounds.emplace_back(bounds.low, bounds.high);
    return Assembler(index + 1).add_range(AffineRow::variable(index), bounds.low, bounds.high, "b", index);
  }

  Expected<void> add_rows() {
    plain_ = model_.bounds;
    for (std::size_t i = 0; i < model_.rows.size(); ++i) {
      const NlBounds& bounds = model_.row_bounds[i];
      const auto added = bounds.complements >= 0 ? add_complementarity(i)
                                                 : add_row(affine(model_.rows[i]), bounds.low, bounds.high,
                                                           static_cast<Index>(i));
      if (!added) return unexpected(of(added.error(), NlPlace::Kind::row, i));
    }
    for (std::size_t i = 0; i < model_.bounds.size(); ++i) {
      const auto index = static_cast<Index>(i);
      const auto added = model_.bounds_apart ? keep_bounds(index, plain_[i])
                                             : add_bounded(AffineRow::variable(index), plain_[i].low,
                                                           plain_[i].high, "b", index, made_.reduced_costs);
      if (!added) return unexpected(of(added.error(), NlPlace::Kind::column, i));
    }
    return {};
  }

  // The parts p and q of a mixed row start such that p − q is the row.
  void take_initial_point() {
    if (model_.initial.empty()) return;
    for (const Index row : mixed_) {
      double value = model_.rows[at(row)].constant;
      for (const auto& [index, coefficient] : model_.rows[at(row)].linear)
        value += coefficient * model_.initial[at(index)];
      model_.initial.insert(model_.initial.end(), {std::max(value, 0.0), std::max(-value, 0.0)});
    }
    made_.file.problem.initial_z = std::move(model_.initial);
  }

  NlModel model_;
  const NlNames& names_;
  Assembler parts_;
  NlProblem made_;
  std::vector<NlBounds> plain_;  // of variables, those that no pair imposes
  std::vector<Index> mixed_;     // rows with two pairs, in the order of their variables
};

}  // namespace

Error NlPlace::named(Error error, const NlNames& names) const {
  switch (kind) {
    case Kind::none:
      break;
    case Kind::row:
      error.bound += ", in constraint " + names.row(index);
      break;
    case Kind::column:
      error.bound += ", of variable " + names.column(index);
      break;
    case Kind::objective:
      error.bound += ", in the objective";
      break;
    case Kind::definition:  // of a subexpression: belongs to no single row
      error.bound += ", in defined variable v" + std::to_string(index);
      break;
  }
  return error;
}

Expected<NlProblem> as_lcqp(NlModel model, const std::string& name, const NlNames& names) {
  return Assembly(std::move(model), names).assemble(name);
}

}  // namespace marble::formats
