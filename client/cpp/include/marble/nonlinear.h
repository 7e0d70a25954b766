// Nonlinear planners: a problem of functions, solved as a sequence of LCQPs, each of them one tick of a
// session.
//
//   min θ(x)   s.t.   c_E(x) = 0,   c_I(x) ≥ 0,   0 ≤ G(x) ⊥ H(x) ≥ 0,   lower ≤ x ≤ upper
//
//   auto answer = marble::nonlinear::solve(problem, marble::Client::in_process());
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "marble/error.h"
#include "marble/options.h"
#include "marble/problem.h"
#include "marble/progress.h"
#include "marble/restart.h"
#include "marble/solution.h"

namespace marble {

class Client;

namespace nonlinear {

/// What the functions are at a point. Views of the caller's memory, read before the next call of any
/// function. A step to where a value or a first derivative is not finite is shortened.
struct Values {
  double objective = 0.0;                     ///< θ, but for ½‖residuals‖²
  std::span<const double> equalities = {};    ///< c_E
  std::span<const double> inequalities = {};  ///< c_I
  std::span<const double> G = {};             ///< n_c
  std::span<const double> H = {};             ///< n_c
  std::span<const double> residuals = {};     ///< ½‖residuals‖² is added to the objective
};

/// Their derivatives: Jacobians with a row a function and a column a variable. Their patterns, those of the
/// first call, are fixed: what may ever be other than zero is an entry. One without rows may be absent.
struct Derivatives {
  std::span<const double> gradient = {};  ///< n, of Values::objective
  SparseMatrixView equalities = {};       ///< ∇c_E
  SparseMatrixView inequalities = {};     ///< ∇c_I
  SparseMatrixView G = {};                ///< ∇G
  SparseMatrixView H = {};                ///< ∇H
  SparseMatrixView residuals = {};        ///< of Values::residuals
};

/// With ∇θ + ∇c_Eᵀy − ∇c_Iᵀν − ∇Gᵀξ − ∇Hᵀη − bounds = 0 at a solution, the signs of `Solution`.
struct Multipliers {
  std::vector<double> equalities;    ///< y, free sign
  std::vector<double> inequalities;  ///< ν ≥ 0
  std::vector<double> G;             ///< ξ, 0 where G > 0
  std::vector<double> H;             ///< η, 0 where H > 0
  std::vector<double> bounds;        ///< n: ≥ 0 of a lower bound, ≤ 0 of an upper one, 0 between
};

/// Where the matrix B of the subproblem's ½ dᵀBd comes from.
enum class Curvature {
  automatic,     ///< exact where there is a Hessian, gauss_newton where there are residuals, else bfgs
  exact,         ///< Problem::hessian, as it is; shifted only where a subproblem finds no minimum with it
  gauss_newton,  ///< JᵀJ of the residuals
  bfgs,          ///< damped BFGS of the Lagrangian, in Problem::blocks
  none,          ///< B = 0: sequential linear programs with pairs
};

/// How a problem is solved. The last three are references, to compare with: they know no pairs and no rows
/// but put all into one smooth function, whose minimum within the bounds the loop of sqpcc finds again and
/// again (K. Murty, "Algorithms for NLP with nonlinear constraints", lectures). client/cpp/NONLINEAR.md has
/// what becomes of them.
enum class Method {
  sqpcc,  ///< a sequence of LCQPs that keep the pairs
  slp,    ///< the same with Curvature::none
  penalty,  ///< exterior: θ + μ (Σ c_E² + Σ max(0, −c_I)² + …), G and H as c_I, G·H as c_E; μ grows tenfold
  alag,  ///< augmented Lagrangian of the same terms, by the method of multipliers
  barrier,  ///< θ − μ Σ log of c_I, G and H; c_E and G·H by penalties 1/μ. Begins where the former are > 0
};

/// By its name. The error's field is "nonlinear_method".
[[nodiscard]] Expected<Method> method_of(std::string_view name);

/// A problem by its functions. What they throw goes through solve(). x has n entries within the bounds.
struct Problem {
  std::function<Values(std::span<const double> x)> values;            ///< wanted
  std::function<Derivatives(std::span<const double> x)> derivatives;  ///< wanted
  /// ∇²θ + Σ y ∇²c_E − Σ ν ∇²c_I − Σ ξ ∇²G − Σ η ∇²H, its upper triangle (row ≤ column), pattern fixed as
  /// above. Entries that are not finite are replaced, by 0 or by the slope's change over the last step.
  /// Optional.
  std::function<SparseMatrixView(std::span<const double> x, const Multipliers& multipliers)> hessian = {};
  /// n, the first x; its size defines n. Moved into the bounds, and off them where a function has no value or
  /// slope there.
  std::vector<double> start = {};
  std::vector<double> lower = {};  ///< n, or empty: −∞; −1e20 and below is none
  std::vector<double> upper = {};  ///< n, or empty: +∞; 1e20 and above is none
  std::vector<double> scale = {};  ///< n, > 0, or empty: 1. A typical change of each variable
  /// Sizes of consecutive groups of variables, their sum n, such that no function couples two groups but
  /// linearly: the stages of a plan. B of bfgs has these blocks on its diagonal. Empty: groups of at most 50.
  std::vector<Index> blocks = {};
};

/// One row of the iteration table.
struct Iteration {
  std::int32_t iteration = 0;      ///< from 0
  double objective = 0.0;          ///< θ at x
  double violation = 0.0;          ///< largest of |c_E|, −c_I, −G, −H, min(G, H)
  double step = 0.0;               ///< max |d_j| / scale_j of the subproblem's answer
  double radius = 0.0;             ///< of the trust region, in the same measure
  double predicted = 0.0;          ///< decrease of the merit by the model, ≥ 0
  double actual = 0.0;             ///< decrease of the merit
  double shift = 0.0;              ///< that was added to B's diagonal
  bool accepted = false;           ///< whether x moves
  bool corrected = false;          ///< by the second-order correction
  bool elastic = false;            ///< the plain subproblem had no answer
  bool restoring = false;          ///< the elastic one did without the objective
  std::int32_t ticks = 0;          ///< LCQPs so far
  std::span<const double> x = {};  ///< where the iteration began; valid only during the call
};

/// All of it optional.
struct Settings {
  Method method = Method::sqpcc;               ///< the loop, or a reference beside it
  Curvature curvature = Curvature::automatic;  ///< of the subproblems; of slp none, of references not none
  double step_tolerance = 1e-8;                ///< max |d_j| / scale_j of a solution, > 0
  double feasibility_tolerance = 1e-6;         ///< violation of a solution, user units, > 0
  double radius = 1.0;                         ///< first one of the trust region, > 0
  double largest_radius = 1e6;                 ///< ≥ radius
  std::int32_t iteration_limit = 200;          ///< subproblems that are linearised or shrunk, ≥ 0
  double time_limit_s = 1e9;                   ///< of all; each tick has what is left as its deadline
  std::function<void(const Iteration&)> iteration = {};  ///< told after every one
  ProgressSink* progress = nullptr;                      ///< told of what each tick does
  std::stop_token stop = {};                             ///< ends it with Status::cancelled
  /// A session whose server dies or drains is set up again, on another one where the client knows several,
  /// and the tick asked again: SessionOptions::reopen. In process there is nothing to reopen.
  bool reopen = false;
  Options lcqp = subproblem_options();  ///< of each tick

  /// Tolerances that are tighter than the defaults, and the pairs' search kept near the branch at hand.
  [[nodiscard]] static Options subproblem_options();
};

/// The newest x that was accepted, solved or not.
struct Answer {
  /// solved: the step is zero and the KKT residual at most 1e-6 of the largest slope; solved_reduced: it is
  /// at most 1e-4, and no step lowers the merit; locally_infeasible: near x the violation cannot be lowered;
  /// numerical_failure: no step lowers the merit, and x is not stationary; or the limit it met.
  Status status = Status::numerical_failure;
  std::string detail;         ///< one sentence: the numbers that justify the status
  std::vector<double> x;      ///< n
  Multipliers multipliers;    ///< of the last subproblem
  double objective = 0.0;     ///< θ
  double violation = 0.0;     ///< as Iteration has it
  double kkt_residual = 0.0;  ///< max |∇θ + ∇c_Eᵀy − …| at x
  /// d = 0 solves the problem linearised at x, pairs kept: no direction of descent that is feasible to first
  /// order. Absent where the subproblem did not decide it.
  std::optional<bool> b_stationary;
  Stationarity stationarity = Stationarity::unknown;  ///< of d = 0 in the linearised problem
  std::int32_t iterations = 0;                        ///< rows of the table
  std::int32_t ticks = 0;                             ///< LCQPs solved
  std::int32_t evaluations = 0;                       ///< calls of Problem::values
  std::int64_t factorizations = 0;                    ///< of all ticks
  std::int32_t reopened = 0;                          ///< how often a session was set up again elsewhere
};

/// What accompanies one tick.
struct TickControls {
  bool cold = false;                       ///< forget the last answer
  double deadline_s = 1e9;                 ///< from now on
  ProgressSink* progress = nullptr;        ///< as Settings has it
  std::span<const double> initial_z = {};  ///< n or empty: starts here, not at the last answer's z
  Shift shift = {};                        ///< the last answer moves on first
};

/// Where the subproblems of one pattern are solved: a session, here or on a server.
class Ticks {
 public:
  virtual ~Ticks() = default;
  /// New numbers, and the answer to them, started from the last one. Errors: deadline_exceeded, cancelled
  /// and whatever ends it.
  [[nodiscard]] virtual Expected<Solution> solve(const ProblemUpdate& update,
                                                 const TickControls& controls) = 0;
  /// The first part of an update: its numbers are taken over, and what an answer needs is made ready, but
  /// nothing is solved; the next solve() brings the rest. False where there is no such thing: then the next
  /// solve() must bring all. Errors: as solve().
  [[nodiscard]] virtual Expected<bool> prepare(const ProblemUpdate& update, const TickControls& controls);
  /// How often it was set up again elsewhere so far.
  [[nodiscard]] virtual std::int32_t reopened() const { return 0; }
};

/// Sets one up. A run opens one, and another one once a subproblem must be elastic.
using OpenTicks =
    std::function<Expected<std::unique_ptr<Ticks>>(const ProblemView& problem, const Settings&)>;

/// In this process, by a WarmSolver each; without the client's library.
[[nodiscard]] Expected<std::unique_ptr<Ticks>> open_ticks_in_process(const ProblemView& problem,
                                                                     const Settings& settings);

/// Solves, each subproblem by what `open` opens. Errors: invalid_argument: fields "start", "lower", "blocks",
/// "settings.radius" and such; "values.G" of what a function gave at the start, with the row as index, and
/// "derivatives.G.row_indices" where a pattern changed; whatever ends a tick, but for a deadline and a stop.
[[nodiscard]] Expected<Answer> solve(const Problem& problem, const OpenTicks& open,
                                     const Settings& settings = {});

/// The same with a session of the client's, in process or on its server: the same bits. Of marble::client.
[[nodiscard]] Expected<Answer> solve(const Problem& problem, const Client& client,
                                     const Settings& settings = {});

/// Moves what of x is at a bound off it, by a hundredth of its scale or of its range: a first point where
/// functions have no value. Variables that are fixed stay. Without a scale it is 1. False where nothing
/// moves.
[[nodiscard]] bool leave_bounds(std::span<double> x, std::span<const double> lower,
                                std::span<const double> upper, std::span<const double> scale = {});

/// Whether the derivatives at `x` agree with central differences of the functions to `tolerance`, relative to
/// the larger of 1 and the entry. The error names the first that does not: field "derivatives.G", the row as
/// index, the column in its words. Entries that a pattern lacks must be zero.
[[nodiscard]] Expected<void> check_derivatives(const Problem& problem, std::span<const double> x,
                                               double tolerance = 1e-5);

}  // namespace nonlinear
}  // namespace marble
