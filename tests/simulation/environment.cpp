#include "environment.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <thread>
#include <utility>

#include "base/wire.h"
#include "disk.h"
#include "judge.h"
#include "marble/v1/service.pb.h"
#include "random.h"
#include "seams.h"
#include "server.h"
#include "service/admission.h"
#include "store/submissions.h"

namespace marble::simulation {
namespace {

using server::ServiceParts;
using std::chrono::duration;

constexpr double kPatience_s = 120.0, kStop_s = 0.15;  // of a call; from a deadline to the answer

void sleep(double seconds) { std::this_thread::sleep_for(duration<double>(seconds)); }
double seconds_now() { return duration<double>(now()).count(); }

class Environment {
 public:
  Environment(const Plan& plan, const std::string& folder, Outcome& outcome)
      : plan_(plan),
        outcome_(outcome),
        judge_(plan, outcome),
        server_(config(plan), folder),
        nemesis_(plan.seed * 7919 + 1) {}

  [[noreturn]] void violated(const std::string& what) { judge_.violated(what); }

  void run() {
    seams().solve_time = [this] { return solve_time(); };
    seams().fault_point = [this](std::string_view name, std::string_view subject) { pass(name, subject); };
    install_disk([] { return draw_share(); });
    judge_.must(server_.start(), "the first start");
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
    if (name == "job") judge_.begins(subject);
    bool dies = name == "job" && subject.starts_with(kFatal);
    {
      const std::lock_guard lock(mutex_);
      if (const auto armed = armed_.find(std::string(name)); armed != armed_.end() && --armed->second <= 0) {
        armed_.erase(armed);
        dies = true;
      }
    }
    if (!dies) return;
    const bool power = name != "job" && name != "take" && draw_share() < 0.5;
    judge_.note(std::string(power ? "the power fails at " : "the server dies at ") + std::string(name) + " " +
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
        judge_.must(server_.start(), "a start after a crash");
        judge_.note("the server is up");
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
        judge_.note(power ? "the power fails" : "the server is killed");
        ++outcome_.crashes;
        server_.kill(power);
      } else if (time > stop) {
        stop = time + nemesis_.exponential(plan_.stop_s);
        judge_.note("the server is stopped");
        ++outcome_.stops;
        server_.stop();
        judge_.note("the server has stopped");
        judge_.expect(seconds_now() < time + 20.0 + 5.0, "a stop takes longer than its grace period");
      }
    }
    set_full(false);
  }

  void set_full(bool full) {
    if (std::exchange(full_, full) == full) return;
    judge_.note(full ? "the disk is full" : "the disk has space again");
    judge_.set_disk_full(full);
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
    if (!value && !reply->is_lost()) judge_.violated(what + " is not answered");
    sleep(random.between(1e-4, 5e-3));
    judge_.expect(reply->times() <= 1, what + " is answered twice");
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
  // One of the newest.
  static Known& any(Me& me) {
    const std::size_t back = me.random.below(std::min<std::size_t>(me.jobs.size(), 8));
    return std::next(me.jobs.rbegin(), static_cast<std::ptrdiff_t>(back))->second;
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
      judge_.note("Submit " + known.request_id + ": lost");
      judge_.submission_lost(known);
      return;
    }
    if (!*answer) {
      judge_.note("Submit " + known.request_id + ": " + (*answer).error().message());
      judge_.expect((*answer).error().code == ErrorCode::unavailable ||
                        (*answer).error().code == ErrorCode::resource_exhausted,
                    "Submit is refused: " + (*answer).error().message());
      judge_.expect(known.id.empty() || (*answer).error().code == ErrorCode::unavailable,
                    "a job that is kept is refused when it is sent again: " + (*answer).error().message());
      return;
    }
    judge_.note("Submit " + known.request_id + ": " + **answer);
    judge_.expect(known.id.empty() || known.id == **answer,
                  "request " + known.request_id + " was job " + known.id + ", and is " + **answer);
    known.id = **answer;
  }

  // The result of a job. True if the job has ended, or does not exist for good reasons.
  bool look(Me& me, Known& known, double patience_s = 30.0) {
    if (known.id.empty()) return true;
    judge_.asks(known);
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
    if (!*answer) return judge_.answered(known, (*answer).error());
    v1::SolveResponse response;
    judge_.expect(response.ParseFromString(**answer), "the answer of " + known.id + " cannot be read");
    return judge_.answered(known, response);
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
    judge_.note("Cancel " + known.id + ": " +
                (!answer   ? "lost"
                 : *answer ? "done"
                           : (*answer).error().message()));
    if (answer && *answer) judge_.is_over(known);
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
    judge_.note("Delete " + known.id + ": " +
                (!answer   ? "lost"
                 : *answer ? "done"
                           : (*answer).error().message()));
    if (!answer) return;
    if (*answer) {
      known.gone = true;
      judge_.is_over(known);
    } else if ((*answer).error().code == ErrorCode::not_found) {
      judge_.expect(again, "job " + known.id + ", which was accepted, cannot be deleted: it is not known");
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
          if (!job) return judge_.violated("a call is refused: " + job.error().message());
          (*job)->observer = observer;
          if (const auto place = parts.scheduler.admit(*job); !place)
            return reply->send(unexpected(place.error()));
          std::unique_lock lock(observer->mutex);
          if (observer->changed.wait_until(lock, end, [&] { return observer->over; })) return;
          lock.unlock();
          parts.scheduler.cancel(*job);  // as gRPC does at the deadline
          lock.lock();
          if (!observer->changed.wait_for(lock, duration<double>(kStop_s), [&] { return observer->over; }))
            judge_.violated("a solve goes on for more than .15 s after its deadline");
        },
        limit_s + kPatience_s);
    if (observer->started_s >= 0.0)
      judge_.expect(observer->started_s <= began_s + limit_s + 0.02, "a solve begins after its deadline");
    judge_.note(std::string("Solve: ") + (!answer                ? "lost"
                                          : !*answer             ? (*answer).error().message()
                                          : !(*answer)->solution ? (*answer)->solution.error().message()
                                                                 : "ended"));
  }

  // Everything that was accepted is answered, and nothing is left.
  void conclude() {
    if (!server_.is_up()) judge_.must(server_.start(), "the last start");
    judge_.note("the clients are done");
    for (Me& me : all_) {
      for (auto& [name, known] : me.jobs) {
        const double begin = seconds_now();
        while (!look(me, known, 60.0)) {
          judge_.expect(seconds_now() < begin + 7200.0, "job " + known.id + " is never answered");
          if (server_.is_up()) continue;
          sleep(1.0);
          judge_.must(server_.start(), "a start");
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
      judge_.expect(tries < 100, "jobs or bytes are left in the queue of a server that nobody uses");
      sleep(1.0);
    }
    const double begin = seconds_now();
    server_.stop();
    judge_.expect(seconds_now() < begin + 2.0, "an idle server takes seconds to stop");
  }

  const Plan plan_;
  Outcome& outcome_;
  Judge judge_;
  Server server_;
  Random nemesis_;
  std::mutex mutex_;
  std::map<std::string, int> armed_;  // fault points at which the server dies, and after how many passes
  bool quiet_ = false;
  bool full_ = false;  // the disk
  std::vector<Me> all_;
};

}  // namespace

void simulate(const Plan& plan, const std::string& folder, Outcome& outcome) {
  static Environment* environment = nullptr;
  run(
      {.seed = plan.seed, .preemption = plan.preemption, .spurious_wakeup = 0.001},
      [&] {
        environment = new Environment(plan, folder,
                                      outcome);  // NOLINT(cppcoreguidelines-owning-memory): threads are left
        environment->run();
      },
      [](const std::string& waits) { environment->violated(waits); });
}

}  // namespace marble::simulation
