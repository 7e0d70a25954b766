#include "threads.h"

#include <memory>
#include <string>
#include <utility>

#include "thread_scheduler.h"

namespace marble::simulation {

Scheduler* scheduler = nullptr;
constinit thread_local Thread* self = nullptr;

namespace {

constexpr std::size_t kStackBytes = std::size_t{1} << 20;

void* run_thread(void* given) {
  auto* const thread = static_cast<Thread*>(given);
  while (sem_wait(&thread->go) != 0) {
  }
  self = thread;
  void* const result = thread->routine(thread->argument);
  scheduler->finish();
  return result;
}

void* run_body(void* given) {
  const std::unique_ptr<std::function<void()>> body(static_cast<std::function<void()>*>(given));
  (*body)();
  return nullptr;
}

}  // namespace

void create(Thread* thread, pthread_t* handle) {
  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, kStackBytes);
  static int (*known)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*) = nullptr;
  const int status = real(known, "pthread_create")(&thread->handle, &attributes, run_thread, thread);
  pthread_attr_destroy(&attributes);
  if (status != 0) scheduler->fail("no more threads can be made");
  thread->handle_known = true;
  if (handle != nullptr) *handle = thread->handle;
  scheduler->begin(thread);
}

void run(const Schedule& schedule, const std::function<void()>& main,
         const std::function<void(const std::string& waits)>& stuck) {
  // Never freed: threads that are left refer to it.
  scheduler = new Scheduler(schedule, stuck);  // NOLINT(cppcoreguidelines-owning-memory)
  self = scheduler->add(0, "main", nullptr, nullptr);
  main();
  self = nullptr;
}

Duration now() { return Duration(scheduler->time()); }
std::uint64_t draw() { return scheduler->random().bits(); }
double draw_share() { return scheduler->random().share(); }
Group new_group(std::string name) { return scheduler->new_group(std::move(name)); }
Group current_group() { return self->group; }
void start(Group group, std::string name, std::function<void()> body) {
  auto* const kept = new std::function<void()>(std::move(body));  // NOLINT(cppcoreguidelines-owning-memory)
  Thread* const thread = scheduler->add(group, std::move(name), run_body, kept);
  create(thread, nullptr);
  pthread_detach(thread->handle);
  scheduler->preemption_point();
}
void kill(Group group) { scheduler->kill(group); }
bool is_alive(Group group) { return scheduler->is_alive(group); }
std::uint64_t digest() { return scheduler->digest(); }
std::int64_t hand_overs() { return scheduler->hand_overs(); }

}  // namespace marble::simulation
