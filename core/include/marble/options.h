// Solver options: one table (options.def), from which everything else follows.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "marble/error.h"

namespace marble {

/// How the relaxation is followed to κ → 0.
enum class Path {
  fast,   ///< ρ at its maximum, κ lowered superlinearly, merit on the residual: a few factorizations
  paper,  ///< Algorithm 1: ρ raised, κ lowered by kappa_factor, filter line search; scaled and polished
  algorithm1,  ///< Algorithm 1 as printed and nothing else: its δ, its end, no scaling, no polish, no search
};

/// By what a solve is done.
enum class Method {
  marble,       ///< this solver: the path, exact branches, local search
  penalty_scp,  ///< π sᵀt linearized, a QP a step, π raised: LCQPow's iteration
  relaxation,   ///< s∘t ≤ τ by an interior point method, τ lowered: Scholtes
  l1_penalty,   ///< μ Σ min(s, t), exact once μ is above the multipliers
  exterior,     ///< μ times the squared distance from the constraints: SUMT
  alag,         ///< the same with estimates of the multipliers: the augmented Lagrangian
  aladin_beta,  ///< ALADIN-β: the next one split, and brought together by a QP a step
  l1_barrier,  ///< ℓ₁ penalty of s∘t = 0 and a barrier of all bounds; both change from problem to problem
  l1_barrier_stepwise,  ///< the same, and both change after every Newton step
  plain_barrier,        ///< the barrier alone: an interior point method on s∘t = 0 as it is
};

/// How a pair's sides s·t = κ are written by one variable.
enum class Retraction {
  softplus,     ///< (4): slopes between 0 and 1
  exponential,  ///< √κ·e^σ and √κ·e^−σ: slopes without bound
};

/// All options, at their defaults unless set. Ranges are closed; validate() checks them.
struct Options {
#define MARBLE_OPTION(type, name, default_value, low, high, unit, doc) type name = default_value;
#include "marble/options.def"
#undef MARBLE_OPTION
};

/// What kind of value an option has.
enum class OptionType {
  real,     ///< double
  integer,  ///< std::int32_t
  boolean,  ///< bool
  choice,   ///< an enum
};

/// Description of one option, for schemas, help texts and conversions.
struct OptionInfo {
  std::string_view name;                      ///< as in Options
  OptionType type;                            ///< decides how the numbers below are read
  double default_value;                       ///< booleans as 0 or 1, choices as their position in `choices`
  double low;                                 ///< least value
  double high;                                ///< largest value
  std::string_view unit;                      ///< "s" for seconds; empty for a pure number
  std::string_view doc;                       ///< one line for people
  std::span<const std::string_view> choices;  ///< names of a choice's values; empty otherwise
};

/// All options in the order of options.def.
[[nodiscard]] std::span<const OptionInfo> option_table();

/// Sets one option from a number (booleans 0/1, choices by position); checks type and range.
[[nodiscard]] Expected<void> set_option(Options& options, std::string_view name, double value);

/// Sets one option from text, as on a command line: "1e-6", "true", "paper".
[[nodiscard]] Expected<void> set_option_text(Options& options, std::string_view name, std::string_view text);

/// Reads one option as a number. The name must exist.
[[nodiscard]] double get_option(const Options& options, std::string_view name);

/// Checks every option against its range.
[[nodiscard]] Expected<void> validate(const Options& options);

/// The same where option explain has no meaning, and must be off: in sessions, coupled and scenario solves.
[[nodiscard]] Expected<void> validate_without_explain(const Options& options);

}  // namespace marble
