#include "http/array_routes.h"

#include <charconv>
#include <future>
#include <memory>
#include <string>

#include "http/caller.h"
#include "http/endpoint.h"
#include "http/reply.h"
#include "http/waiting.h"
#include "service/job_access.h"
#include "store/array_source.h"
#include "store/submissions.h"

namespace marble::server::http {
namespace {

constexpr std::int64_t kPageBytes = 1 << 20;        // of stored results
constexpr std::int64_t kBytesOfPage = 12;           // memory for each of them: message and JSON
constexpr std::chrono::milliseconds kShortly{300};  // for results that other servers have stored
constexpr std::chrono::seconds kFindPatience{5};    // of a store that does not answer

// Waits for news of an array.
class Listener final : public ArrayListener {
 public:
  void news() override ABSL_LOCKS_EXCLUDED(mutex_) {
    {
      const MutexLock lock(mutex_);
      news_ = true;
    }
    wake_.notify_all();
  }
  void wait(Clock::time_point until) ABSL_LOCKS_EXCLUDED(mutex_) {
    const MutexLock lock(mutex_);
    while (!news_ && wake_.wait_until(mutex_, until) == std::cv_status::no_timeout) {
    }
    news_ = false;
  }

 private:
  Mutex mutex_;
  Condition wake_;
  bool news_ ABSL_GUARDED_BY(mutex_) = false;
};

Expected<FoundArray> find(const ServiceParts& parts, const Identity& caller, const std::string& id) {
  const auto reported = std::make_shared<std::promise<Expected<FoundArray>>>();
  auto found = reported->get_future();
  parts.submissions->find_array(
      id, [reported](Expected<FoundArray> array) { reported->set_value(std::move(array)); });
  if (found.wait_for(kFindPatience) != std::future_status::ready)
    return unexpected(failure(ErrorCode::unavailable, "state", "", "does not answer"));
  auto array = found.get();
  if (array && !may_end(caller, array->client)) return unexpected(no_array(id));
  return array;
}

Expected<std::int64_t> after_of(const httplib::Request& request, std::int64_t elements) {
  if (!request.has_param("after")) return 0;
  const std::string text = request.get_param_value("after");
  std::int64_t after = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), after);
  if (error == std::errc() && end == text.data() + text.size() && after >= 0 && after <= elements)
    return after;
  return unexpected(invalid("after", text, "must be in [0, " + std::to_string(elements) + "], the elements"));
}

// Returns the first news after this result, or none if there are none in time. Errors: unavailable (the
// server shuts down), and those of the array.
Expected<ArraySource::News> wait_for_news(const ServiceParts& parts, ArraySource& array, std::int64_t after,
                                          Clock::time_point until) {
  const auto listener = std::make_shared<Listener>();
  array.listen(listener);
  while (true) {
    auto news = array.news_after(after, kPageBytes);
    if (!news || !news->answers.empty() || news->is_over) return news;
    if (parts.scheduler.is_drained() && parts.submissions->is_settled()) return unexpected(draining());
    const auto now = Clock::now();
    if (now >= until) return news;
    listener->wait(std::min<Clock::time_point>(until, now + kLook));
  }
}

// One message per line.
std::string lines_of(const std::vector<ElementAnswer>& answers) {
  std::string lines;
  for (const ElementAnswer& answer : answers) lines += to_json(message_of(answer)) + "\n";
  return lines;
}

Answer results_page(const ServiceParts& parts, Semaphore& semaphore) {
  return [&parts, &semaphore](const httplib::Request& request, const Identity& caller,
                              httplib::Response& response) -> Expected<void> {
    const std::string id = request.matches[1].str();
    MARBLE_RETURN_IF_ERROR(check_parameters(request, {"after", "wait"}));
    MARBLE_ASSIGN_OR_RETURN(const auto wait_s, wait_of(parts, request));
    MARBLE_ASSIGN_OR_RETURN(const auto array, find(parts, caller, id));
    MARBLE_ASSIGN_OR_RETURN(const auto after, after_of(request, array.elements));
    std::unique_ptr<Waiting> waiting;
    if (wait_s > 0.0) {
      MARBLE_ASSIGN_OR_RETURN(waiting, Waiting::begin(parts, semaphore, caller.client));
    }
    const auto patience = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(wait_s));
    MARBLE_ASSIGN_OR_RETURN(const auto news,
                            wait_for_news(parts, *array.results, after,
                                          Clock::now() + std::max<Clock::duration>(patience, kShortly)));
    // tokens and roles can be reloaded
    MARBLE_ASSIGN_OR_RETURN(const auto still, parts.access.identify(credentials_of(request)));
    if (!may_end(still, array.client)) return unexpected(no_array(id));
    if (news.is_over && news.end) {
      reply_failed_job(response, id, *news.end);
      return {};
    }
    if (news.is_over) {
      response.status = 204;
      return {};
    }
    if (news.answers.empty()) {
      response.set_header("Retry-After", "1");
      return unexpected(failure(ErrorCode::failed_precondition, "after", std::to_string(after),
                                "is followed by no result yet; wait, or come back"));
    }
    std::int64_t bytes = 0;
    for (const ElementAnswer& answer : news.answers)
      bytes += static_cast<std::int64_t>(answer.message.size());
    MARBLE_ASSIGN_OR_RETURN(auto memory, semaphore.hold(caller.client, kBytesOfPage * bytes));
    return reply_long_bytes(response, semaphore, std::move(memory),
                            std::make_shared<const std::string>(lines_of(news.answers)),
                            "application/x-ndjson");
  };
}

}  // namespace

void add_array_routes(Router& router, const ServiceParts& parts, Semaphore& semaphore) {
  router.get("/api/jobs/([^/]+)/results", endpoint(parts, results_page(parts, semaphore)));
}

}  // namespace marble::server::http
