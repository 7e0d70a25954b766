#include "http/event_routes.h"

#include <utility>

#include "http/caller.h"
#include "http/endpoint.h"
#include "http/reply.h"
#include "service/server_info.h"

namespace marble::server::http {
namespace {

constexpr std::chrono::seconds kSilence{3};  // after this, a comment tests whether the client still reads
constexpr std::chrono::seconds kRecheck{2};  // for checks of the caller: tokens and roles can be reloaded

/// One event stream: writes frames to one client as they come.
class EventStream {
 public:
  EventStream(const ServiceParts& parts, Credentials given, std::unique_ptr<EventHub::Viewer> viewer,
              std::string first)
      : parts_(parts), given_(std::move(given)), viewer_(std::move(viewer)), first_(std::move(first)) {}

  /// Writes the next piece; false once the client no longer reads.
  [[nodiscard]] bool write(httplib::DataSink& sink) {
    if (!first_.empty()) return put(sink, std::exchange(first_, ""));
    const Clock::time_point now = Clock::now();
    if (now - checked_ >= kRecheck) {
      checked_ = now;
      const auto caller = parts_.access.identify(given_);
      if (!caller || !viewer_->is_for(*caller)) return end(sink);
    }
    const EventHub::Viewer::Next next = viewer_->next(kRecheck);
    switch (next.what) {
      case EventHub::Viewer::Next::frame:
        return put(sink, *next.bytes);
      case EventHub::Viewer::Next::missed:
        return put(sink, event("reload", "{}"));
      case EventHub::Viewer::Next::over:
        return end(sink);
      case EventHub::Viewer::Next::quiet:
        break;
    }
    return now - written_ < kSilence || put(sink, ":\n\n");
  }

 private:
  bool put(httplib::DataSink& sink, const std::string& text) {
    written_ = Clock::now();
    return sink.write(text.data(), text.size());
  }
  static bool end(httplib::DataSink& sink) {
    sink.done();
    return true;
  }

  const ServiceParts& parts_;
  const Credentials given_;
  const std::unique_ptr<EventHub::Viewer> viewer_;
  std::string first_;
  Clock::time_point checked_ = Clock::now(), written_ = checked_;
};

void stream(const ServiceParts& parts, const httplib::Request& request,
            std::unique_ptr<EventHub::Viewer> viewer, const std::string& first, httplib::Response& response) {
  const auto events = std::make_shared<EventStream>(parts, credentials_of(request), std::move(viewer),
                                                    "retry: 1000\n\n" + first);
  response.set_chunked_content_provider(
      "text/event-stream", [events](std::size_t, httplib::DataSink& sink) { return events->write(sink); });
}

std::string hello(const ServiceParts& parts, const Identity& caller) {
  v1::GetInfoResponse info;
  fill_info(parts, caller, &info);
  info.clear_options();  // the longest part, and constant: /api/info has it
  return event("hello", to_json(info));
}

}  // namespace

void add_event_routes(Router& router, const ServiceParts& parts, EventHub& hub) {
  router.get("/api/events", endpoint(parts,
                                     [&](const httplib::Request& request, const Identity& caller,
                                         httplib::Response& response) -> Expected<void> {
                                       MARBLE_ASSIGN_OR_RETURN(auto viewer, hub.watch_all(caller));
                                       stream(parts, request, std::move(viewer), hello(parts, caller),
                                              response);
                                       return {};
                                     }));
  router.get("/api/jobs/([^/]+)/events", endpoint(parts,
                                                  [&](const httplib::Request& request, const Identity& caller,
                                                      httplib::Response& response) -> Expected<void> {
                                                    const std::string id = request.matches[1].str();
                                                    MARBLE_RETURN_IF_ERROR(look(parts, id));
                                                    MARBLE_ASSIGN_OR_RETURN(auto viewer,
                                                                            hub.watch_job(caller, id));
                                                    stream(parts, request, std::move(viewer), "", response);
                                                    return {};
                                                  }));
}

}  // namespace marble::server::http
