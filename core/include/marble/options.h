// Solver options. The table options.def defines them; everything else is generated from it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "marble/error.h"

namespace marble {

/// How the path of the relaxation is followed to κ → 0.
enum class Path {
  fast,  ///< ρ at its maximum, κ lowered superlinearly, merit function on the residual: a few factorizations
  paper,  ///< Algorithm 1: ρ raised, κ lowered by kappa_factor, filter line search; scaled and polished
  algorithm1,  ///< Algorithm 1 exactly as printed: its δ, its end, no scaling, no polish, no search
};

/// The method of a solve.
enum class Method {
  marble,       ///< this solver: the path, exact branches, local search
  penalty_scp,  ///< π sᵀt linearized, one QP per step, π raised: LCQPow's iteration
  relaxation,   ///< s∘t ≤ τ by an interior point method, τ lowered: Scholtes
  l1_penalty,   ///< μ Σ min(s, t), exact once μ is above the multipliers
  exterior,     ///< μ times the squared distance to the constraints: SUMT
  alag,         ///< the same with estimates of the multipliers: the augmented Lagrangian
  aladin_beta,  ///< ALADIN-β: l1_barrier split into parts, which one QP per step brings together
  l1_barrier,  ///< ℓ₁ penalty of s∘t = 0 and a barrier for all bounds; both change from problem to problem
  l1_barrier_stepwise,  ///< the same, and both change after every Newton step
  plain_barrier,        ///< the barrier alone: an interior point method on s∘t = 0 itself
};

/// How one variable represents the two sides of a pair with s·t = κ.
enum class Retraction {
  softplus,     ///< (4): slopes between 0 and 1
  exponential,  ///< √κ·e^σ and √κ·e^−σ: unbounded slopes
};

/// All options, with their default values. Ranges are closed; validate() checks them.
struct Options {
#define MARBLE_OPTION(type, name, default_value, low, high, unit, doc) type name = default_value;
#include "marble/options.def"
#undef MARBLE_OPTION
};

/// The type of an option's value.
enum class OptionType {
  real,     ///< double
  integer,  ///< std::int32_t
  boolean,  ///< bool
  choice,   ///< an enum
};

/// Description of one option, for schemas, help texts and conversions.
struct OptionInfo {
  std::string_view name;                      ///< as in Options
  OptionType type;                            ///< how to read the numbers below
  double default_value;                       ///< booleans as 0 or 1, choices as their position in `choices`
  double low;                                 ///< smallest value
  double high;                                ///< largest value
  std::string_view unit;                      ///< "s" for seconds; empty for a pure number
  std::string_view doc;                       ///< one line for users
  std::span<const std::string_view> choices;  ///< names of a choice's values; empty otherwise
  bool research;                              ///< serves only the paper's algorithm and comparisons
};

/// Returns all options in the order of options.def.
[[nodiscard]] std::span<const OptionInfo> option_table();

/// Sets one option from a number (booleans 0/1, choices by position); checks type and range.
[[nodiscard]] Expected<void> set_option(Options& options, std::string_view name, double value);

/// Sets one option from text, as on a command line: "1e-6", "true", "paper".
[[nodiscard]] Expected<void> set_option_text(Options& options, std::string_view name, std::string_view text);

/// Reads one option as a number. The name must exist.
[[nodiscard]] double get_option(const Options& options, std::string_view name);

/// Checks every option against its range, and that `method` is marble. The library marble_research runs the
/// other methods.
[[nodiscard]] Expected<void> validate(const Options& options);

/// Checks only the ranges.
[[nodiscard]] Expected<void> validate_ranges(const Options& options);

/// The same for solves in which option explain has no meaning and must be off: in sessions, coupled and
/// scenario solves.
[[nodiscard]] Expected<void> validate_without_explain(const Options& options);

}  // namespace marble
