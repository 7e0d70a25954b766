#include "world.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <map>
#include <random>
#include <set>
#include <sstream>
#include <thread>

#include "base/wire.h"
#include "disk.h"
#include "marble/v1/service.pb.h"
#include "seams.h"
#include "server.h"
#include "service/admission.h"
#include "service/job_requests.h"
#include "service/reply.h"

namespace marble::simulation {
namespace {

using server::ServiceParts;
using std::chrono::duration;

constexpr std::size_t kHistory = 60;          // events that a report shows
constexpr double kPatience_s = 120.0;         // a call that takes longer hangs
constexpr double kStop_s = 0.15;              // from a deadline to the answer
constexpr int kStarts = 2;                    // setting job_starts
constexpr std::string_view kFatal = "fatal";  // request ids of jobs that kill their server begin so

class Random {
 public:
  explicit Random(std::uint64_t seed) : random_(seed) {}
  double share() { return static_cast<double>(random_() >> 11) * 0x1p-53; }
  bool chance(double probability) { return share() < probability; }
  double between(double least, double most) { return least + (most - least) * share(); }
  double exponential(double mean) { return -mean * std::log(1.0 - share()); }
  std::size_t below(std::size_t count) { return static_cast<std::size_t>(random_() % count); }

 private:
  std::mt19937_64 random_;
};

void sleep(double seconds) { std::this_thread::sleep_for(duration<double>(seconds)); }
double seconds_now() { return duration<double>(now()).count(); }

// A job that a client has asked for, and what it knows of it.
struct Known {
  std::string request_id = {};
  double gradient = 0.0;
  std::string id = {};   // empty until the server has said it
  bool deleted = false;  // asked for, whether or not the answer came
  bool gone = false;     // its deletion was confirmed
  bool cancelled = false;
  bool ended = false;               // seen as finished
  std::string answer = {};          // as first seen
  std::int64_t crashes_before = 0;  // of the server, when it was first asked for
  std::int64_t full_changes = 0;    // of the disk, when it was last asked for its answer
  std::int64_t unwritten_at =
      -1;  // lives of the server, when an answer came while the disk may have been full
};

class World {
 public:
  World(const Plan& plan, const std::string& folder, Outcome& outcome)
      : plan_(plan), outcome_(outcome), server_(config(plan), folder), nemesis_(plan.seed * 7919 + 1) {}

  void run() {
    seams().solve_time = [this] { return solve_time(); };
    seams().fault_point = [this](std::string_view name, std::string_view subject) { pass(name, subject); };
    install_disk([] { return draw_share(); });
    must(server_.start(), "the first start");
    std::vector<std::thread> clients;
    for (int k = 0; k < plan_.clients; ++k) clients.emplace_back([this, k] { live(k); });
    std::thread nemesis([this] { disturb(); });
    for (std::thread& client : clients) client.join();
    {
      const std::lock_guard lock(mutex_);
      quiet_ = true;
      armed_.clear();
    }
    nemesis.join();
    conclude();
    outcome_.hours = seconds_now() / 3600.0;
    outcome_.digest = digest();
    outcome_.hand_overs = hand_overs();
  }

  [[noreturn]] void violated(const std::string& what) {
    outcome_.violation = what;
    std::string text;
    for (const std::string& line : history_) text += line + '\n';
    outcome_.history = text;
    std::printf("seed %llu: %s\nafter %.3f s:\n%s", static_cast<unsigned long long>(plan_.seed), what.c_str(),
                seconds_now(), text.c_str());
    std::fflush(stdout);
    _exit(1);
  }

 private:
  static server::Config config(const Plan& plan) {
    server::Config config;
    config.workers = plan.workers;
    config.queue_jobs = plan.queue_jobs;
    config.client_queued = 0;
    config.result_keep_s = 1e8;
    config.history_jobs = 1000000;
    config.drain_grace_s = 20.0;
    return config;
  }

  void note(const std::string& line) {
    const std::lock_guard lock(mutex_);
    char time[32];
    std::snprintf(time, sizeof time, "%12.6f  ", seconds_now());
    history_.push_back(time + line);
    if (history_.size() > kHistory) history_.pop_front();
  }
  void must(const Expected<void>& done, const std::string& what) {
    if (!done) violated(what + " fails: " + done.error().message());
  }
  void expect(bool holds, const std::string& what) {
    if (!holds) violated(what);
  }

  Duration solve_time() {
    ++outcome_.solves;
    // Log-normal, as recorded solves are: most are short, a few ten times the mean.
    const double u = std::max(draw_share(), 1e-12), v = draw_share();
    const double normal = std::sqrt(-2.0 * std::log(u)) * std::cos(6.283185307179586 * v);
    const double time = plan_.solve_s * std::exp(1.2 * normal - 0.72);
    return std::chrono::duration_cast<Duration>(duration<double>(std::min(time, 60.0)));
  }

  // On a thread of the server.
  void pass(std::string_view name, std::string_view subject) {
    bool dies = name == "job" && subject.starts_with(kFatal);
    {
      const std::lock_guard lock(mutex_);
      if (name == "job" && over_.contains(std::string(subject)))
        violated("job " + std::string(subject) + " begins after its cancellation or deletion was confirmed");
      if (dies && ++deaths_[std::string(subject)] > kStarts + lost_submits_[std::string(subject)])
        violated("job " + std::string(subject) + " is begun again, and has killed the server twice");
      if (const auto armed = armed_.find(std::string(name)); armed != armed_.end() && --armed->second <= 0) {
        armed_.erase(armed);
        dies = true;
      }
    }
    if (!dies) return;
    const bool power = name != "job" && name != "take" && draw_share() < 0.5;
    note(std::string(power ? "the power fails at " : "the server dies at ") + std::string(name) + " " +
         std::string(subject));
    ++outcome_.crashes;
    server_.kill(power);
  }

  // Kills the server, stops it, and starts it again.
  void disturb() {
    double crash = nemesis_.exponential(plan_.crash_s), stop = nemesis_.exponential(plan_.stop_s);
    double full = nemesis_.exponential(plan_.full_s);
    while (true) {
      sleep(nemesis_.exponential(1.0));
      {
        const std::lock_guard lock(mutex_);
        if (quiet_) break;
      }
      if (const double time = seconds_now(); time > full) {
        set_full(!full_);
        full = time + nemesis_.exponential(full_ ? 10.0 : plan_.full_s);
      }
      if (!server_.is_up()) {
        sleep(nemesis_.exponential(plan_.down_s));
        if (server_.is_up()) continue;
        set_full(false);
        must(server_.start(), "a start after a crash");
        note("the server is up");
        continue;
      }
      const double time = seconds_now();
      if (time > crash) {
        crash = time + nemesis_.exponential(plan_.crash_s);
        constexpr const char* kPoints[] = {"before_commit", "after_commit", "before_answer", "take", "job"};
        if (const std::size_t which = nemesis_.below(2 * std::size(kPoints)); which < std::size(kPoints)) {
          const std::lock_guard lock(mutex_);
          armed_[kPoints[which]] = 1 + static_cast<int>(nemesis_.below(4));
          continue;
        }
        const bool power = nemesis_.chance(0.4);
        note(power ? "the power fails" : "the server is killed");
        ++outcome_.crashes;
        server_.kill(power);
      } else if (time > stop) {
        stop = time + nemesis_.exponential(plan_.stop_s);
        note("the server is stopped");
        ++outcome_.stops;
        server_.stop();
        note("the server has stopped");
        expect(seconds_now() < time + 20.0 + 5.0, "a stop takes longer than its grace period");
      }
    }
    set_full(false);
  }

  void set_full(bool full) {
    if (full == full_) return;
    full_ = full;
    ++full_changes_;
    note(full ? "the disk is full" : "the disk has space again");
    set_disk_full(full);
  }

  // A call, with its way there and back. Null: nobody knows whether it was done.
  template <class Value>
  std::optional<Value> call(
      Random& random, const std::string& what,
      std::function<void(const ServiceParts&, const std::shared_ptr<Reply<Value>>&)> handle,
      double patience_s = kPatience_s) {
    ++outcome_.calls;
    sleep(random.between(1e-4, 5e-3));
    const auto reply = std::make_shared<Reply<Value>>();
    if (!server_.call<Value>(reply, std::move(handle))) return std::nullopt;
    auto value = reply->wait(std::chrono::duration_cast<Duration>(duration<double>(patience_s)));
    if (!value && !reply->is_lost()) violated(what + " is not answered");
    sleep(random.between(1e-4, 5e-3));
    expect(reply->times() <= 1, what + " is answered twice");
    if (random.chance(plan_.lost_reply)) return std::nullopt;
    return value;
  }

  struct Me {
    Random random;
    server::Caller caller;
    std::map<std::string, Known> jobs;  // by request id
    int next = 0;
  };

  static std::shared_ptr<v1::SolveRequest> request_of(const std::string& request_id, double gradient) {
    auto request = std::make_shared<v1::SolveRequest>();
    request->set_request_id(request_id);
    v1::Problem& p = *request->mutable_problem();
    const auto unit = [](int rows, int first, v1::SparseMatrix* out) {
      out->set_rows(rows);
      out->set_columns(2);
      out->add_column_pointers(0);
      for (int j = 0; j < 2; ++j) {
        if (rows == 2 || j == first) out->add_row_indices(rows == 2 ? j : 0), out->add_values(1.0);
        out->add_column_pointers(out->values_size());
      }
    };
    unit(2, 0, p.mutable_hessian());
    p.add_gradient(gradient);
    p.add_gradient(-1.0);
    unit(1, 0, p.mutable_left_matrix());
    unit(1, 1, p.mutable_right_matrix());
    p.add_left_offset(0.0);
    p.add_right_offset(0.0);
    return request;
  }

  void live(int number) {
    Me me{.random = Random(plan_.seed * 1000003 + static_cast<std::uint64_t>(number)),
          .caller = {},
          .jobs = {}};
    me.caller.identity = {"client " + std::to_string(number), {server::Role::solve}};
    const double end = plan_.hours * 3600.0;
    while (true) {
      sleep(me.random.exponential(plan_.think_s));
      if (seconds_now() > end) break;
      act(me);
    }
    const std::lock_guard lock(mutex_);
    all_.push_back(std::move(me));
  }

  void act(Me& me) {
    const double kind = me.random.share();
    if (kind < 0.3 || me.jobs.empty()) {
      submit(me, std::string());
    } else if (kind < 0.4) {
      submit(me, any(me).request_id);
    } else if (kind < 0.6) {
      (void)look(me, any(me));
    } else if (kind < 0.65) {
      cancel(me, any(me));
    } else if (kind < 0.72) {
      remove(me, any(me));
    } else {
      solve(me);
    }
  }
  static Known& any(Me& me) {
    auto at = me.jobs.begin();
    // Mostly one of the newest.
    const std::size_t back = 1 + me.random.below(std::min<std::size_t>(me.jobs.size(), 8));
    std::advance(at, static_cast<std::ptrdiff_t>(me.jobs.size() - back));
    return at->second;
  }

  // A new job, or one once more: until the server has said that it has it, a client sends it again.
  void submit(Me& me, const std::string& again) {
    std::string name = again;
    if (name.empty()) {
      char text[64];
      std::snprintf(text, sizeof text, "%06d", me.next++);
      name = me.caller.identity.client + " " + text;
      const bool fatal = me.random.chance(plan_.fatal_job);
      Known known{.request_id = fatal ? std::string(kFatal) + " " + name : name,
                  .gradient = me.random.between(-2.0, 2.0),
                  .crashes_before = outcome_.crashes};
      me.jobs.emplace(name, known);
      ++outcome_.jobs;
    } else {
      for (const auto& [key, known] : me.jobs) {
        if (known.request_id == again) name = key;
      }
    }
    Known& known = me.jobs.at(name);
    if (known.deleted) return;
    using Answer = Expected<std::string>;
    const auto answer = call<Answer>(
        me.random, "Submit " + known.request_id,
        [caller = me.caller, known](const ServiceParts& parts, const std::shared_ptr<Reply<Answer>>& reply) {
          const auto response = std::make_shared<v1::SubmitResponse>();
          const auto taken =
              parts.submissions->submit(caller, request_of(known.request_id, known.gradient), response.get());
          if (!taken) return reply->send(unexpected(taken.error()));
          const auto then = [reply, response](const Expected<void>& kept) {
            reply->send(kept ? Answer(response->job_id()) : unexpected(kept.error()));
          };
          *taken ? (*taken)(then) : then({});
        });
    if (!answer) {
      note("Submit " + known.request_id + ": lost");
      const std::lock_guard lock(mutex_);
      ++lost_submits_[known.request_id];  // it may have run before it was kept
      return;
    }
    if (!*answer) {
      note("Submit " + known.request_id + ": " + (*answer).error().message());
      expect((*answer).error().code == ErrorCode::unavailable ||
                 (*answer).error().code == ErrorCode::resource_exhausted,
             "Submit is refused: " + (*answer).error().message());
      expect(known.id.empty() || (*answer).error().code == ErrorCode::unavailable,
             "a job that is kept is refused when it is sent again: " + (*answer).error().message());
      return;
    }
    note("Submit " + known.request_id + ": " + **answer);
    expect(known.id.empty() || known.id == **answer,
           "request " + known.request_id + " was job " + known.id + ", and is " + **answer);
    known.id = **answer;
  }

  // The result of a job. True if the job has ended, or does not exist for good reasons.
  bool look(Me& me, Known& known, double patience_s = 30.0) {
    if (known.id.empty()) return true;
    forget_unwritten(known);
    known.full_changes = full_changes_;
    using Answer = Expected<std::string>;
    struct Wait {
      std::mutex mutex;
      std::condition_variable changed;
      bool over = false;
    };
    const auto answer = call<Answer>(
        me.random, "Result " + known.id,
        [id = known.id, patience_s](const ServiceParts& parts, const std::shared_ptr<Reply<Answer>>& reply) {
          if (parts.results.owner(id).empty())
            return reply->send(unexpected(failure(ErrorCode::not_found, "job_id", id, "is no job")));
          const auto wait = std::make_shared<Wait>();
          parts.results.wait(id, wait.get(), [reply, wait, id](const server::ResultStore::Shared& result) {
            if (result == nullptr) {
              reply->send(unexpected(failure(ErrorCode::not_found, "job_id", id, "was deleted")));
            } else if (!result->answer) {
              reply->send(unexpected(result->answer.error()));
            } else {
              reply->send(server::bytes_of(*result->answer));
            }
            const std::lock_guard lock(wait->mutex);
            wait->over = true;
            wait->changed.notify_all();
          });
          std::unique_lock lock(wait->mutex);
          const bool over =
              wait->changed.wait_for(lock, duration<double>(patience_s), [&] { return wait->over; });
          lock.unlock();
          if (over) return;
          parts.results.stop_waiting(id, wait.get());
          // It may have come in between.
          if (reply->times() == 0)
            reply->send(
                unexpected(failure(ErrorCode::failed_precondition, "job_id", id, "has not finished")));
        },
        patience_s + kPatience_s);
    if (!answer) return false;
    forget_unwritten(known);
    if (!*answer) return judge(known, (*answer).error());
    expect(!known.gone, "job " + known.id + ", which was deleted, has an answer");
    v1::SolveResponse response;
    expect(response.ParseFromString(**answer), "the answer of " + known.id + " cannot be read");
    judge(known, response);
    return true;
  }

  bool judge(Known& known, const Error& error) {
    note("Result " + known.id + ": " + error.message());
    switch (error.code) {
      case ErrorCode::not_found:
        expect(known.deleted, "job " + known.id + ", which was accepted, is not known any more");
        known.gone = true;
        return true;
      case ErrorCode::failed_precondition:
        expect(!known.ended, "job " + known.id + " had ended, and has not");
        return false;
      case ErrorCode::unavailable:  // the server stops
        expect(!known.ended, "job " + known.id + " had an answer, and has none: " + error.message());
        return false;
      default:
        // A job that ran at two crashes is not begun a third time, whether or not it was their cause.
        expect(known.cancelled || known.deleted || outcome_.crashes >= known.crashes_before + 2,
               "job " + known.id + " fails: " + error.message());
        return same(known, "error " + error.message());
    }
  }

  void judge(Known& known, const v1::SolveResponse& response) {
    const v1::Solution& solution = response.solution();
    note("Result " + known.id + ": status " + std::to_string(solution.status()));
    expect(response.job_id() == known.id, "the answer of " + known.id + " is that of " + response.job_id());
    expect(!known.request_id.starts_with(kFatal), "a job that kills its server has an answer");
    if (solution.status() == v1::STATUS_SOLVED) {
      // The better of two branches: min ½z₀² + az₀ over z₀ ≥ 0, and min ½z₁² − z₁ over z₁ ≥ 0.
      const double a = std::max(0.0, -known.gradient), best = std::min(-0.5 * a * a, -0.5);
      expect(std::abs(solution.objective() - best) < 1e-6,
             "the answer of " + known.id + " is that of another job");
    } else {
      expect(known.cancelled || known.deleted, "job " + known.id + " is not solved");
    }
    (void)same(known,
               "status " + std::to_string(solution.status()) + " " + std::to_string(solution.objective()));
  }

  // What was answered while nothing could be written ends with the server, which then solves it again.
  void forget_unwritten(Known& known) {
    if (known.unwritten_at < 0 || known.unwritten_at == outcome_.crashes + outcome_.stops) return;
    known.unwritten_at = -1;
    known.ended = false;
    known.answer.clear();
  }

  bool same(Known& known, const std::string& answer) {
    if (known.answer.empty() && (full_ || full_changes_ != known.full_changes))
      known.unwritten_at = outcome_.crashes + outcome_.stops;
    expect(known.answer.empty() || known.answer == answer,
           "the answer of " + known.id + " was '" + known.answer + "', and is '" + answer + "'");
    known.answer = answer;
    known.ended = true;
    return true;
  }

  void cancel(Me& me, Known& known) {
    if (known.id.empty() || known.gone) return;
    known.cancelled = true;
    using Answer = Expected<void>;
    const auto answer =
        call<Answer>(me.random, "Cancel " + known.id,
                     [caller = me.caller, id = known.id](const ServiceParts& parts,
                                                         const std::shared_ptr<Reply<Answer>>& reply) {
                       const auto response = std::make_shared<v1::CancelJobResponse>();
                       const auto asked = parts.submissions->cancel(caller.identity, id, response.get());
                       if (!asked) return reply->send(unexpected(asked.error()));
                       *asked ? (*asked)([reply, response](const Expected<void>& done) { reply->send(done); })
                              : reply->send({});
                     });
    note("Cancel " + known.id + ": " + (!answer ? "lost" : *answer ? "done" : (*answer).error().message()));
    if (answer && *answer) set_over(known);
  }

  void set_over(const Known& known) {
    const std::lock_guard lock(mutex_);
    over_.insert(known.request_id);
  }

  void remove(Me& me, Known& known) {
    if (known.id.empty() || known.gone) return;
    const bool again = known.deleted;
    known.deleted = true;
    using Answer = Expected<void>;
    const auto answer = call<Answer>(
        me.random, "Delete " + known.id,
        [caller = me.caller, id = known.id](const ServiceParts& parts,
                                            const std::shared_ptr<Reply<Answer>>& reply) {
          const auto asked = parts.submissions->remove(caller.identity, id);
          if (!asked) return reply->send(unexpected(asked.error()));
          *asked ? (*asked)([reply](const Expected<void>& done) { reply->send(done); }) : reply->send({});
        });
    note("Delete " + known.id + ": " + (!answer ? "lost" : *answer ? "done" : (*answer).error().message()));
    if (!answer) return;
    if (*answer) {
      known.gone = true;
      set_over(known);
    } else if ((*answer).error().code == ErrorCode::not_found) {
      expect(again, "job " + known.id + ", which was accepted, cannot be deleted: it is not known");
      known.gone = true;
    }
  }

  // One solve within a call, mostly with a deadline.
  void solve(Me& me) {
    struct Observer final : server::JobObserver {
      using Answer = Expected<server::Outcome>;
      std::shared_ptr<Reply<Answer>> reply;
      std::mutex mutex;
      std::condition_variable changed;
      bool over = false;
      double started_s = -1.0;
      void started(double) override { started_s = seconds_now(); }
      void finished(server::Outcome outcome) override {
        reply->send(std::move(outcome));
        const std::lock_guard lock(mutex);
        over = true;
        changed.notify_all();
      }
    };
    using Answer = Observer::Answer;
    const double limit_s = me.random.chance(0.7) ? me.random.exponential(4.0 * plan_.solve_s) : kPatience_s;
    const double gradient = me.random.between(-2.0, 2.0);
    const auto observer = std::make_shared<Observer>();
    const double began_s = seconds_now();
    const auto answer = call<Answer>(
        me.random, "Solve",
        [this, caller = me.caller, limit_s, gradient, observer](const ServiceParts& parts,
                                                                const std::shared_ptr<Reply<Answer>>& reply) {
          observer->reply = reply;
          server::Caller own = caller;
          const auto end = server::Clock::now() +
                           std::chrono::duration_cast<server::Clock::duration>(duration<double>(limit_s));
          own.deadline = end;
          const auto job = make_job(parts, own, server::JobKind::solve, request_of("", gradient));
          if (!job) return violated("a call is refused: " + job.error().message());
          (*job)->observer = observer;
          if (const auto place = parts.scheduler.admit(*job); !place)
            return reply->send(unexpected(place.error()));
          std::unique_lock lock(observer->mutex);
          if (observer->changed.wait_until(lock, end, [&] { return observer->over; })) return;
          lock.unlock();
          parts.scheduler.cancel(*job);  // as gRPC does at the deadline
          lock.lock();
          if (!observer->changed.wait_for(lock, duration<double>(kStop_s), [&] { return observer->over; }))
            violated("a solve goes on for more than .15 s after its deadline");
        },
        limit_s + kPatience_s);
    if (observer->started_s >= 0.0)
      expect(observer->started_s <= began_s + limit_s + 0.02, "a solve begins after its deadline");
    note(std::string("Solve: ") + (!answer                ? "lost"
                                   : !*answer             ? (*answer).error().message()
                                   : !(*answer)->solution ? (*answer)->solution.error().message()
                                                          : "ended"));
  }

  // Everything that was accepted is answered, and nothing is left.
  void conclude() {
    if (!server_.is_up()) must(server_.start(), "the last start");
    note("the clients are done");
    for (Me& me : all_) {
      for (auto& [name, known] : me.jobs) {
        const double begin = seconds_now();
        while (!look(me, known, 60.0)) {
          expect(seconds_now() < begin + 7200.0, "job " + known.id + " is never answered");
          if (server_.is_up()) continue;
          sleep(1.0);
          must(server_.start(), "a start");
        }
      }
    }
    using Answer = server::Counters;
    for (int tries = 0;; ++tries) {
      const auto counters = call<Answer>(
          nemesis_, "counters", [](const ServiceParts& parts, const std::shared_ptr<Reply<Answer>>& reply) {
            reply->send(parts.scheduler.counters());
          });
      if (counters && counters->queued == 0 && counters->running == 0 && counters->request_bytes == 0) break;
      expect(tries < 100, "jobs or bytes are left in the queue of a server that nobody uses");
      sleep(1.0);
    }
    const double begin = seconds_now();
    server_.stop();
    expect(seconds_now() < begin + 2.0, "an idle server takes seconds to stop");
  }

  const Plan plan_;
  Outcome& outcome_;
  Server server_;
  Random nemesis_;
  std::mutex mutex_;
  std::deque<std::string> history_;
  std::map<std::string, int> armed_;  // fault points at which the server dies, and after how many passes
  bool quiet_ = false;
  std::set<std::string, std::less<>>
      over_;                           // request ids of jobs whose cancellation or deletion was confirmed
  std::map<std::string, int> deaths_;  // of the server, by the request id of the job that it ran
  std::map<std::string, int> lost_submits_;  // by request id
  bool full_ = false;                        // the disk
  std::int64_t full_changes_ = 0;
  std::vector<Me> all_;
};

}  // namespace

Plan Plan::drawn(std::uint64_t seed, double hours) {
  Random random(seed);
  Plan plan{.seed = seed, .hours = hours};
  plan.clients = 1 + static_cast<int>(random.below(8));
  plan.workers = 1 + static_cast<int>(random.below(3));
  plan.queue_jobs = random.chance(0.3) ? 4 + static_cast<int>(random.below(8)) : 64;
  plan.think_s = std::exp(random.between(std::log(0.3), std::log(20.0)));
  plan.solve_s = std::exp(random.between(std::log(0.02), std::log(5.0)));
  plan.crash_s = std::exp(random.between(std::log(20.0), std::log(2000.0)));
  plan.stop_s = std::exp(random.between(std::log(100.0), std::log(5000.0)));
  if (random.chance(0.3)) plan.full_s = std::exp(random.between(std::log(50.0), std::log(1000.0)));
  plan.down_s = std::exp(random.between(std::log(0.1), std::log(30.0)));
  plan.lost_reply = random.chance(0.5) ? 0.0 : random.between(0.0, 0.1);
  plan.fatal_job = random.chance(0.6) ? 0.0 : random.between(0.0, 0.02);
  plan.preemption = random.chance(0.5) ? 0.02 : random.between(0.0, 0.2);
  return plan;
}

void simulate(const Plan& plan, const std::string& folder, Outcome& outcome) {
  static World* world = nullptr;
  run(
      {.seed = plan.seed, .preemption = plan.preemption, .spurious_wakeup = 0.001},
      [&] {
        world =
            new World(plan, folder, outcome);  // NOLINT(cppcoreguidelines-owning-memory): threads are left
        world->run();
      },
      [](const std::string& waits) { world->violated(waits); });
}

}  // namespace marble::simulation
