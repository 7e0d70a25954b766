// Solves nonlinear problems given by functions, as a sequence of LCQPs, each of which is one update of a
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

/// Function values at a point. Views of the caller's memory, read before the next call of any function. A
/// step to a point where a value or a first derivative is not finite is shortened.
struct Values {
  double objective = 0.0;                     ///< θ, without ½‖residuals‖²
  std::span<const double> equalities = {};    ///< c_E
  std::span<const double> inequalities = {};  ///< c_I
  std::span<const double> G = {};             ///< n_c
  std::span<const double> H = {};             ///< n_c
  std::span<const double> residuals = {};     ///< ½‖residuals‖² is added to the objective
};

/// Derivatives at a point: Jacobians with a row per function and a column per variable. The patterns of the
/// first call are fixed: every entry that may ever be nonzero must be in them. A Jacobian without rows may be
/// absent.
struct Derivatives {
  std::span<const double> gradient = {};  ///< n, of Values::objective
  SparseMatrixView equalities = {};       ///< ∇c_E
  SparseMatrixView inequalities = {};     ///< ∇c_I
  SparseMatrixView G = {};                ///< ∇G
  SparseMatrixView H = {};                ///< ∇H
  SparseMatrixView residuals = {};        ///< of Values::residuals
};

/// Multipliers with ∇θ + ∇c_Eᵀy − ∇c_Iᵀν − ∇Gᵀξ − ∇Hᵀη − bounds = 0 at a solution, with the signs of
/// `Solution`.
struct Multipliers {
  std::vector<double> equalities;    ///< y, free sign
  std::vector<double> inequalities;  ///< ν ≥ 0
  std::vector<double> G;             ///< ξ, 0 where G > 0
  std::vector<double> H;             ///< η, 0 where H > 0
  std::vector<double> bounds;        ///< n: ≥ 0 for a lower bound, ≤ 0 for an upper one, 0 between
};

/// The source of the matrix B in the subproblem's ½ dᵀBd.
enum class Curvature {
  automatic,     ///< exact if there is a Hessian, gauss_newton if there are residuals, else bfgs
  exact,         ///< Problem::hessian, unchanged; shifted only if a subproblem finds no minimum with it
  gauss_newton,  ///< JᵀJ of the residuals
  bfgs,          ///< damped BFGS of the Lagrangian, in Problem::blocks
  none,          ///< B = 0: sequential linear programs with pairs
};

/// The method that solves a problem. The last three are references for comparison. They do not treat pairs
/// and rows as such but put all into one smooth function, which the loop of sqpcc minimizes repeatedly within
/// the bounds (K. Murty, "Algorithms for NLP with nonlinear constraints", lectures). client/cpp/NONLINEAR.md
/// has their results.
enum class Method {
  sqpcc,  ///< a sequence of LCQPs that keep the pairs
  slp,    ///< the same with Curvature::none
  penalty,  ///< exterior: θ + μ (Σ c_E² + Σ max(0, −c_I)² + …), G and H as c_I, G·H as c_E; μ grows tenfold
  alag,     ///< augmented Lagrangian of the same terms, by the method of multipliers
  barrier,  ///< θ − μ Σ log of c_I, G and H; c_E and G·H by penalties 1/μ. Starts where c_I, G, H > 0
};

/// Returns a method by its name. The error's field is "nonlinear_method".
[[nodiscard]] Expected<Method> method_of(std::string_view name);

/// A problem given by its functions. Exceptions that they throw pass through solve(). x has n entries within
/// the bounds.
struct Problem {
  std::function<Values(std::span<const double> x)> values;            ///< required
  std::function<Derivatives(std::span<const double> x)> derivatives;  ///< required
  /// Returns ∇²θ + Σ y ∇²c_E − Σ ν ∇²c_I − Σ ξ ∇²G − Σ η ∇²H, its upper triangle (row ≤ column), with a fixed
  /// pattern as above. Entries that are not finite are replaced by 0 or by the slope's change over the last
  /// step. Optional.
  std::function<SparseMatrixView(std::span<const double> x, const Multipliers& multipliers)> hessian = {};
  /// n, the first x; its size defines n. Moved into the bounds, and off them if a function has no value or
  /// slope there.
  std::vector<double> start = {};
  std::vector<double> lower = {};  ///< n, or empty: −∞; −1e20 and below means no bound
  std::vector<double> upper = {};  ///< n, or empty: +∞; 1e20 and above means no bound
  std::vector<double> scale = {};  ///< n, > 0, or empty: 1. A typical change of each variable
  /// Sizes of consecutive groups of variables, with sum n, such that functions couple two groups only
  /// linearly: the stages of a plan. B of bfgs has these blocks on its diagonal. Empty: groups of at most 50.
  std::vector<Index> blocks = {};
};

/// One row of the iteration table.
struct Iteration {
  std::int32_t iteration = 0;      ///< from 0
  double objective = 0.0;          ///< θ at x
  double violation = 0.0;          ///< largest of |c_E|, −c_I, −G, −H, min(G, H)
  double step = 0.0;               ///< max |d_j| / scale_j of the subproblem's solution
  double radius = 0.0;             ///< of the trust region, in the same measure
  double predicted = 0.0;          ///< decrease of the merit in the model, ≥ 0
  double actual = 0.0;             ///< decrease of the merit
  double shift = 0.0;              ///< added to B's diagonal
  bool accepted = false;           ///< whether x moves
  bool corrected = false;          ///< by the second-order correction
  bool elastic = false;            ///< the plain subproblem had no solution
  bool restoring = false;          ///< the elastic one had no objective
  std::int32_t ticks = 0;          ///< LCQPs solved so far
  std::span<const double> x = {};  ///< the start of the iteration; valid only during the call
};

/// All fields are optional.
struct Settings {
  Method method = Method::sqpcc;               ///< the main loop, or a reference method
  Curvature curvature = Curvature::automatic;  ///< of the subproblems; slp: none; references: not none
  double step_tolerance = 1e-8;                ///< max |d_j| / scale_j of a solution, > 0
  double feasibility_tolerance = 1e-6;         ///< violation of a solution, user units, > 0
  double radius = 1.0;                         ///< first radius of the trust region, > 0; may grow
  double largest_radius = 1e6;                 ///< ≥ radius
  std::int32_t iteration_limit = 200;          ///< subproblems that are linearized or shrunk, ≥ 0
  double time_limit_s = 1e9;  ///< in total; each LCQP gets the remaining time as its deadline
  std::function<void(const Iteration&)> iteration = {};  ///< called after each iteration
  ProgressSink* progress = nullptr;                      ///< reports the progress of each LCQP
  std::stop_token stop = {};                             ///< ends the solve with Status::cancelled
  /// A session whose server dies or drains is opened again, on another server if the client has several, and
  /// the LCQP is solved again: SessionOptions::reopen. No effect in process.
  bool reopen = false;
  Options lcqp = subproblem_options();  ///< of each LCQP

  /// Returns options with tighter tolerances than the defaults, and a search over pairs that stays near the
  /// current branch.
  [[nodiscard]] static Options subproblem_options();
};

/// The last accepted x, solved or not.
struct Answer {
  /// solved: the step is zero and the KKT residual at most 1e-6 of the largest slope; almost_solved: the
  /// residual is at most 1e-4, and no step lowers the merit; locally_infeasible: near x the violation cannot
  /// be lowered; numerical_failure: no step lowers the merit, and x is not stationary; or the limit that
  /// ended the solve.
  Status status = Status::numerical_failure;
  std::string detail;         ///< one sentence: the numbers that justify the status
  std::vector<double> x;      ///< n
  Multipliers multipliers;    ///< of the last subproblem
  double objective = 0.0;     ///< θ
  double violation = 0.0;     ///< as Iteration::violation
  double kkt_residual = 0.0;  ///< max |∇θ + ∇c_Eᵀy − …| at x
  /// True if d = 0 solves the problem linearized at x with its pairs: there is no descent direction that is
  /// feasible to first order. Absent if the subproblem did not decide it.
  std::optional<bool> b_stationary;
  Stationarity stationarity = Stationarity::unknown;  ///< of d = 0 in the linearized problem
  std::int32_t iterations = 0;                        ///< rows of the table
  std::int32_t ticks = 0;                             ///< LCQPs solved
  std::int32_t evaluations = 0;                       ///< calls of Problem::values
  std::int64_t factorizations = 0;                    ///< of all ticks
  std::int32_t reopened = 0;                          ///< how often a session was opened again elsewhere
};

/// Options of one LCQP solve.
struct TickControls {
  bool cold = false;                       ///< discard the last solution
  double deadline_s = 1e9;                 ///< from now on
  ProgressSink* progress = nullptr;        ///< as Settings::progress
  std::span<const double> initial_z = {};  ///< n or empty: start here, not at the last solution's z
  Shift shift = {};                        ///< shifts the last solution first
};

/// The solver of the subproblems with one pattern: a session, local or remote.
class Ticks {
 public:
  virtual ~Ticks() = default;
  /// Solves with new numbers, starting from the last solution. Errors: deadline_exceeded, cancelled and any
  /// error that ends the session.
  [[nodiscard]] virtual Expected<Solution> solve(const ProblemUpdate& update,
                                                 const TickControls& controls) = 0;
  /// Processes the first part of an update: stores its numbers and prepares the solve, but solves nothing;
  /// the next solve() brings the rest. Returns false if this is not supported: then the next solve() must
  /// bring all. Errors: as solve().
  [[nodiscard]] virtual Expected<bool> prepare(const ProblemUpdate& update, const TickControls& controls);
  /// Returns how often the session was opened again elsewhere so far.
  [[nodiscard]] virtual std::int32_t reopened() const { return 0; }
};

/// Opens a session. A run opens one, and another one when a subproblem must be elastic.
using OpenTicks =
    std::function<Expected<std::unique_ptr<Ticks>>(const ProblemView& problem, const Settings&)>;

/// Opens a WarmSolver in this process, without the client's library.
[[nodiscard]] Expected<std::unique_ptr<Ticks>> open_ticks_in_process(const ProblemView& problem,
                                                                     const Settings& settings);

/// Solves the problem; `open` provides the solver of each subproblem. Errors: invalid_argument, with fields
/// "start", "lower", "blocks", "settings.radius" and such; "values.G" if a function's value at the start is
/// invalid, with the row as index; "derivatives.G.row_indices" if a pattern changed; any error that ends an
/// LCQP solve, except a deadline and a stop.
[[nodiscard]] Expected<Answer> solve(const Problem& problem, const OpenTicks& open,
                                     const Settings& settings = {});

/// The same with a session of the client, in process or on its server: the same bits. Part of marble::client.
[[nodiscard]] Expected<Answer> solve(const Problem& problem, const Client& client,
                                     const Settings& settings = {});

/// Moves the entries of x that are at a bound off it, by a hundredth of their scale or range: for a start
/// where functions have no value. Fixed variables stay. Without `scale` it is 1. Returns false if nothing
/// moves.
[[nodiscard]] bool leave_bounds(std::span<double> x, std::span<const double> lower,
                                std::span<const double> upper, std::span<const double> scale = {});

/// Checks that the derivatives at `x` agree with central differences of the functions to `tolerance`,
/// relative to the larger of 1 and the entry. The error names the first entry that does not: field
/// "derivatives.G", the row as index, the column in the message. Entries outside a pattern must be zero.
[[nodiscard]] Expected<void> check_derivatives(const Problem& problem, std::span<const double> x,
                                               double tolerance = 1e-5);

}  // namespace nonlinear
}  // namespace marble
