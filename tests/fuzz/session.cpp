// A session's messages, one after the other, through the session's own checks and its solver: setups (each
// opens another session) and updates that are solved, prepared, superseded or abandoned. Every answer is
// judged by the numbers in force. A session that prepares gives the same bits as one that solves each update
// in one step. At its end the numbers of all its answers are solved again, as one batch.
#include <google/protobuf/stubs/logging.h>

#include <cstring>
#include <deque>
#include <map>
#include <optional>

#include "base/wire.h"
#include "calls/waiting_updates.h"
#include "expect.h"
#include "marble/batch_solver.h"
#include "marble/convert.h"
#include "requests/findings.h"
#include "requests/judge.h"
#include "requests/make.h"
#include "requests/mutate.h"
#include "requests/work.h"
#include "service/reply.h"

using namespace marble;
using server::Update;

namespace {

// As an update has it: of a full Q the upper entries count.
void take(const v1::ProblemUpdate& update, v1::Problem* problem) {
  if (update.has_constant()) problem->set_constant(update.constant());
  const auto renew = [](const auto& from, auto* to) {
    if (!from.empty()) to->CopyFrom(from);
  };
  renew(update.gradient(), problem->mutable_gradient());
  renew(update.equality_offset(), problem->mutable_equality_offset());
  renew(update.inequality_offset(), problem->mutable_inequality_offset());
  renew(update.left_offset(), problem->mutable_left_offset());
  renew(update.right_offset(), problem->mutable_right_offset());
  renew(update.equality_values(), problem->mutable_equality_matrix()->mutable_values());
  renew(update.inequality_values(), problem->mutable_inequality_matrix()->mutable_values());
  renew(update.left_values(), problem->mutable_left_matrix()->mutable_values());
  renew(update.right_values(), problem->mutable_right_matrix()->mutable_values());
  if (update.hessian_values().empty()) return;
  v1::SparseMatrix& Q = *problem->mutable_hessian();
  renew(update.hessian_values(), Q.mutable_values());
  if (problem->hessian_form() == v1::HESSIAN_FORM_UPPER_TRIANGLE) return;
  std::map<std::pair<int, int>, double> upper;
  const auto each = [&Q](const auto& visit) {
    for (int j = 0; j + 1 < Q.column_pointers_size(); ++j) {
      for (int k = Q.column_pointers(j); k < Q.column_pointers(j + 1); ++k) visit(Q.row_indices(k), j, k);
    }
  };
  each([&](int i, int j, int k) {
    if (i <= j) upper[{i, j}] = Q.values(k);
  });
  each([&](int i, int j, int k) {
    if (i > j) Q.set_values(k, upper[{j, i}]);
  });
}

// What an update that is solution of changes, in the order of arrival.
struct News {
  std::int64_t sequence;
  v1::ProblemUpdate numbers;
};

// One session, with its twin that never prepares.
class Session {
 public:
  static std::optional<Session> open(const server::ServiceParts& parts, v1::SessionSetup& setup) {
    fuzz::limit_budgets(setup.mutable_options());
    if (const auto valid = server::check_progress(setup.progress_interval_s(), setup.iterate_every());
        !valid) {
      fuzz::expect_sound(valid.error());
      return std::nullopt;
    }
    const auto checked =
        server::check_request(parts, fuzz::any_caller(), {}, server::JobKind::session, setup);
    if (!checked) {
      fuzz::expect_sound(checked.error());
      FUZZ_EXPECT(!checked.error().field.empty());
      return std::nullopt;
    }
    const SetupControls limits{.most_bytes = parts.config.solve_bytes};
    auto solver = WarmSolver::create(checked->problem, checked->options, checked->initial_z, limits);
    auto twin = WarmSolver::create(checked->problem, checked->options, checked->initial_z, limits);
    if (!solver || !twin) {
      fuzz::expect_sound(solver.error());
      return std::nullopt;
    }
    return Session(parts, setup, checked->options, PartSizes::of(checked->problem), *std::move(solver),
                   *std::move(twin));
  }

  [[nodiscard]] const PartSizes& sizes() const { return sizes_; }

  // Some wait for the next one, so that they supersede each other or are solved together.
  void take(v1::SessionUpdate& message) {
    if (message.sequence() <= newest_) return;
    newest_ = message.sequence();
    fuzz::limit_budgets(message.mutable_options());
    if (message.deadline_s() > 0.0) message.set_deadline_s(0.0);
    const News news{message.sequence(), message.problem()};
    const std::optional<v1::SensitivityRequest> asked =
        message.has_sensitivity() ? std::optional(message.sensitivity()) : std::nullopt;
    v1::SessionUpdate same = message;
    const auto limits = server::SensitivityLimits::of(parts_->config);
    auto update = Update::check(message, sizes_, options_, limits);
    if (!update) {
      fuzz::expect_sound(update.error());
      FUZZ_EXPECT(update.error().field.starts_with("update"));
      return;
    }
    auto other = Update::check(same, sizes_, options_, limits);
    FUZZ_EXPECT(other.has_value());
    options_ = update->options();
    news_.push_back(news);
    asked_[news.sequence] = asked;
    push(waiting_, *std::move(update));
    push(twin_waiting_, *std::move(other));
    if (news.sequence % 3 != 0) work();
  }

  void end() {
    work();
    judge_batch();
  }

  // The numbers of the answers as a batch: the same bits on any number of threads, and each is judged.
  void judge_batch() const {
    if (solved_.empty()) return;
    const std::size_t count = solved_.size();
    std::vector<double> parts[11];
    for (const v1::Problem& problem : solved_) {
      const ProblemView view = view_of(problem);
      const std::span<const double> own[] = {{&view.c0, 1}, view.g,        view.b,        view.d,
                                             view.l,        view.r,        view.Q.values, view.A.values,
                                             view.C.values, view.L.values, view.R.values};
      for (std::size_t k = 0; k < std::size(own); ++k)
        parts[k].insert(parts[k].end(), own[k].begin(), own[k].end());
    }
    const BatchNumbers numbers{count,    parts[0], parts[1], parts[2], parts[3], parts[4],
                               parts[5], parts[6], parts[7], parts[8], parts[9], parts[10]};
    const auto solve = [&](int threads) {
      auto solver = BatchSolver::create(Problem::create(view_of(solved_.front())).value(), options_);
      FUZZ_EXPECT(solver.has_value());
      auto result = solver->solve(numbers, {.threads = threads, .multipliers = true});
      FUZZ_EXPECT(result.has_value());
      return *std::move(result);
    };
    const BatchResult result = solve(1), other = solve(3);
    const auto same = [](const std::vector<double>& a, const std::vector<double>& b) {
      return a.size() == b.size() &&
             (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0);
    };
    FUZZ_EXPECT(result.status == other.status && result.factorizations == other.factorizations);
    FUZZ_EXPECT(same(result.z, other.z) && same(result.objective, other.objective));
    for (std::size_t i = 0; i < count; ++i) {
      if (is_solved(result.status[i])) judge_element(result, i);
    }
  }

  void work() {
    while (!waiting_.empty()) {
      const std::shared_ptr<Update> update = waiting_.pop();
      if (update->sequence() % 7 == 5) {  // its deadline passed, say
        waiting_.leave_behind(std::move(*update));
        // Its twin may have become one with it or with a part of it: from here on they differ.
        is_twin_ = false;
        if (waiting_.empty()) return;
        continue;
      }
      if (update->prepares()) {
        FUZZ_EXPECT(solver_.prepare(update->checked()).has_value());
      } else {
        answer(*update);
      }
    }
  }

 private:
  Session(const server::ServiceParts& parts, const v1::SessionSetup& setup, const Options& options,
          const PartSizes& sizes, WarmSolver solver, WarmSolver twin)
      : parts_(&parts),
        problem_(setup.problem()),
        options_(options),
        sizes_(sizes),
        solver_(std::move(solver)),
        twin_(std::move(twin)),
        waiting_(setup.latest_only()),
        twin_waiting_(setup.latest_only()) {}

  static void push(server::WaitingUpdates& waiting, Update update) {
    const auto superseded = waiting.push(std::make_shared<Update>(std::move(update)), nullptr);
    if (superseded) FUZZ_EXPECT(!waiting.empty());
  }

  void answer(const Update& update) {
    while (!news_.empty() && news_.front().sequence <= update.sequence()) {
      ::take(news_.front().numbers, &problem_);
      news_.pop_front();
    }
    if (solved_.size() < kMostOfABatch) solved_.push_back(problem_);
    const auto asked = update.sensitivity();
    server::Outcome outcome;
    outcome.solution = solver_.solve(update.checked(), {.sensitivity = asked ? &*asked : nullptr});
    FUZZ_EXPECT(outcome.solution.has_value());
    v1::SessionResponse response;
    server::fill_solution(outcome, update.options(), response.mutable_answer()->mutable_solution());
    const v1::Solution& solution = response.answer().solution();
    fuzz::expect_sound(solution);
    fuzz::judge_answer(view_of(problem_), update.options(), solution);
    if (const auto& request = asked_[update.sequence()])
      fuzz::judge_derivatives(view_of(problem_), *request, solution);
    expect_twin(update, *outcome.solution);
  }

  void judge_element(const BatchResult& result, std::size_t i) const {
    const auto row = [&](const std::vector<double>& values) {
      const std::span<const double> own(values);
      const std::size_t size = own.size() / result.count;
      const auto part = own.subspan(i * size, size);
      return std::vector<double>(part.begin(), part.end());
    };
    Solution solution;
    solution.status = result.status[i];
    solution.detail = "an element of a batch";
    solution.z = row(result.z);
    solution.equality_multipliers = row(result.equality_multipliers);
    solution.inequality_multipliers = row(result.inequality_multipliers);
    solution.complementarity_multipliers_L = row(result.complementarity_multipliers_L);
    solution.complementarity_multipliers_R = row(result.complementarity_multipliers_R);
    solution.objective = result.objective[i];
    const double* violations = &result.violations[3 * i];
    solution.violations = {violations[0], violations[1], violations[2]};
    solution.kkt_residual = result.kkt_residual[i];
    server::Outcome outcome;
    outcome.solution = std::move(solution);
    v1::Solution message;
    server::fill_solution(outcome, options_, &message);
    fuzz::judge_answer(view_of(solved_[i]), options_, message);
  }

  void expect_twin(const Update& update, const Solution& solution) {
    if (!is_twin_) return;
    FUZZ_EXPECT(!twin_waiting_.empty());
    const std::shared_ptr<Update> same = twin_waiting_.pop();
    FUZZ_EXPECT(same->sequence() == update.sequence());
    const auto asked = same->sensitivity();
    const auto own = twin_.solve(same->checked(), {.sensitivity = asked ? &*asked : nullptr});
    FUZZ_EXPECT(own && own->status == solution.status && own->z.size() == solution.z.size());
    FUZZ_EXPECT(own->z.empty() ||
                std::memcmp(own->z.data(), solution.z.data(), own->z.size() * sizeof(double)) == 0);
  }

  const server::ServiceParts* parts_;
  v1::Problem problem_;  // in force
  Options options_;      // of the newest update
  PartSizes sizes_;
  WarmSolver solver_, twin_;
  server::WaitingUpdates waiting_, twin_waiting_;
  bool is_twin_ = true;
  std::deque<News> news_;
  std::map<std::int64_t, std::optional<v1::SensitivityRequest>> asked_;
  std::int64_t newest_ = 0;
  static constexpr std::size_t kMostOfABatch = 12;
  std::vector<v1::Problem> solved_;  // the numbers of its answers
};

}  // namespace

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t most,
                                               unsigned seed) {
  return fuzz::mutate_bytes<fuzz::Script>(data, size, most, seed, fuzz::make_session);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return fuzz::judged(data, size, [&] {
    static const google::protobuf::LogSilencer silence;
    static const fuzz::SmallParts parts;
    fuzz::Script script;
    if (!script.ParseFromArray(data, static_cast<int>(size))) return;
    std::optional<Session> session;
    for (int k = 0; k < std::min(script.details_size(), 16); ++k) {
      const grpc::Slice slice(script.details(k).value());
      grpc::ByteBuffer bytes(&slice, 1);
      v1::SessionRequest request;
      const auto parsed = session ? server::parse_update(bytes, session->sizes(), &request, 1 << 16)
                                  : server::parse(&bytes, &request);
      if (!parsed) {
        fuzz::expect_sound(parsed.error());
      } else if (request.has_setup()) {
        if (session) session->end();
        session.reset();
        if (auto opened = Session::open(parts.all, *request.mutable_setup()))
          session.emplace(std::move(*opened));
      } else if (request.has_update() && session) {
        session->take(*request.mutable_update());
      }
    }
    if (session) session->end();
  });
}
