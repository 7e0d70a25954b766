#include <algorithm>
#include <deque>
#include <new>

#include "connection/connection.h"
#include "connection/patience.h"
#include "marble/batch.h"
#include "marble/convert.h"
#include "marble/jobs.h"
#include "message/answer.h"
#include "message/job_message.h"
#include "message/request.h"
#include "message/status.h"
#include "message_text.h"
#include "remote/has_server.h"
#include "remote/queue_wait.h"

namespace marble {
namespace {

using client::Patience;
using Seconds = Patience::Seconds;
using Writer = grpc::ClientWriter<v1::SubmitArrayRequest>;

constexpr Seconds kShortestPause(0.01);

Expected<void> fill(const ArrayControls& controls, v1::ArraySetup* setup) {
  MARBLE_RETURN_IF_ERROR(client::check_request_id(controls.request_id));
  if (controls.base != nullptr) marble::to_message(controls.base->view(), setup->mutable_problem());
  setup->set_name(client::message_text(controls.name, contract::longest_problem_name));
  marble::to_message(controls.options, setup->mutable_options());
  setup->set_request_id(controls.request_id.empty() ? client::random_request_id() : controls.request_id);
  setup->set_priority(client::to_message(controls.priority));
  return {};
}

Expected<void> fill(const ArrayElement& element, v1::ArrayElement* message) {
  v1::SolveRequest* solve = message->mutable_solve();
  if (element.problem) {
    marble::to_message(*element.problem, solve->mutable_problem());
    solve->mutable_problem()->set_name(
        client::message_text(element.problem_name, contract::longest_problem_name));
  } else {
    marble::to_message(element.update, message->mutable_update());
  }
  if (element.options) marble::to_message(*element.options, solve->mutable_options());
  if (!element.initial_z.empty())
    solve->mutable_initial_point()->mutable_z()->Assign(element.initial_z.begin(), element.initial_z.end());
  if (element.warm_start != nullptr) marble::to_message(*element.warm_start, solve->mutable_warm_start());
  if (element.sensitivity != nullptr) marble::to_message(*element.sensitivity, solve->mutable_sensitivity());
  return client::check_size(*message);
}

// The messages of one array, for one or more attempts to send it.
class ArrayMessages {
 public:
  ArrayMessages(const ArraySource& source, const ArrayControls& controls)
      : source_(source), stop_(controls.stop), is_kept_(controls.queue_wait != Seconds(0.0)) {}

  Expected<void> set_up(const ArrayControls& controls) {
    v1::SubmitArrayRequest request;
    MARBLE_RETURN_IF_ERROR(fill(controls, request.mutable_setup()));
    keep(std::move(request));
    (void)rewind();
    return {};
  }

  // Returns the next message; null at the end, or if the caller cancelled.
  Expected<const v1::SubmitArrayRequest*> next() {
    if (at_ < kept_.size()) return &kept_[at_++];
    if (has_ended_) return nullptr;
    const std::optional<ArrayElement> element = source_();
    if (stop_.stop_requested()) return nullptr;  // the source itself may request it: then nothing is kept
    v1::SubmitArrayRequest request;
    if (!element) {
      has_ended_ = true;
      request.mutable_end()->set_elements(elements_);
    } else if (auto filled = fill(*element, request.mutable_element()); !filled) {
      return unexpected(inside("elements[" + std::to_string(elements_) + "]", filled.error()));
    } else {
      ++elements_;
    }
    keep(std::move(request));
    return &kept_.back();
  }

  // Begins the next attempt. Returns false if messages of the last one are gone.
  [[nodiscard]] bool rewind() {
    at_ = 0;
    return is_kept_;
  }

 private:
  static constexpr std::size_t kMostKept = 64U << 20U;  // bytes
  static constexpr std::size_t kBesides = 512;          // of a message, about

  void keep(v1::SubmitArrayRequest request) {
    bytes_ += request.ByteSizeLong() + kBesides;
    if (bytes_ > kMostKept) is_kept_ = false;
    if (!is_kept_) kept_.clear();
    kept_.push_back(std::move(request));
    at_ = kept_.size();
  }

  const ArraySource& source_;
  const std::stop_token& stop_;
  std::deque<v1::SubmitArrayRequest> kept_;  // of this attempt and those before, or only the newest
  std::size_t at_ = 0, bytes_ = 0;
  std::int64_t elements_ = 0;
  bool is_kept_, has_ended_ = false;
};

// Writes until the messages end or the server stops reading; its status then has the reason.
Expected<void> write(Writer& writer, ArrayMessages& messages) {
  while (true) {
    MARBLE_ASSIGN_OR_RETURN(const auto message, messages.next());
    if (message == nullptr || !writer.Write(*message)) break;
  }
  writer.WritesDone();
  return {};
}

// Returns how long to wait for a server that was lost; nothing for other errors, or if it was long enough.
std::optional<Seconds> pause_after(const grpc::Status& status, Patience& patience) {
  if (status.error_code() != grpc::StatusCode::UNAVAILABLE) return std::nullopt;
  return patience.pause();
}

ArrayAnswer answer_of(const v1::ArrayResultsResponse& response) {
  ArrayAnswer answer{response.index(), response.sequence(), unexpected(Error{})};
  if (response.has_result()) {
    answer.answer = client::remote_solution(response.result());
  } else {
    answer.answer = unexpected(client::to_error(response.error()));
  }
  return answer;
}

}  // namespace

Expected<SubmittedArray> Jobs::submit_array(const ArraySource& source, const ArrayControls& controls) const
    try {
  MARBLE_RETURN_IF_ERROR(client::has_server(connection_.get()));
  MARBLE_ASSIGN_OR_RETURN(
      auto wait, client::QueueWait::create(controls.queue_wait, connection_->deadline_of(controls.deadline),
                                           controls.stop, controls.waiting));
  ArrayMessages messages(source, controls);
  MARBLE_RETURN_IF_ERROR(messages.set_up(controls));
  Patience patience(std::nullopt, connection_->reached());
  while (true) {
    grpc::ClientContext context;
    connection_->prepare(context, wait.left());
    const std::stop_callback cancel_on_stop(controls.stop, [&context] { context.TryCancel(); });
    v1::SubmitArrayResponse response;
    const auto writer = connection_->jobs().SubmitArray(&context, &response);
    const auto written = write(*writer, messages);
    if (!written) context.TryCancel();
    const grpc::Status status = writer->Finish();
    if (!written) return unexpected(written.error());
    if (status.ok()) {
      connection_->note_reached();
      return SubmittedArray{response.job_id(), response.elements()};
    }
    if (!messages.rewind()) return unexpected(wait.error(status));
    if (const auto pause = pause_after(status, patience)) {
      const auto left = wait.left();
      if ((left && *pause >= *left) || connection_->pause(*pause, controls.stop))
        return unexpected(wait.error(status));
    } else if (!wait.pause(status)) {
      return unexpected(wait.error(status));
    }
  }
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

// Makes a lost connection again; a result begins the wait for the server anew.
Expected<void> Jobs::array(const std::string& job_id, const ArraySink& sink,
                           const ArrayReading& reading) const try {
  MARBLE_RETURN_IF_ERROR(client::has_server(connection_.get()));
  std::int64_t after = reading.after;
  Patience patience(std::nullopt, connection_->reached());
  while (true) {
    grpc::ClientContext context;
    connection_->prepare(context);
    const std::stop_callback cancel_on_stop(reading.stop, [&context] { context.TryCancel(); });
    v1::ArrayResultsRequest request;
    request.set_job_id(job_id);
    request.set_after(after);
    const auto reader = connection_->jobs().ArrayResults(&context, request);
    v1::ArrayResultsResponse response;
    while (reader->Read(&response)) {
      after = response.sequence();
      patience.reached();
      connection_->note_reached();
      sink(answer_of(response));
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) return {};
    auto pause = client::retry_after(status);
    if (pause) patience.reached();
    if (!pause) pause = pause_after(status, patience);
    if (!pause || connection_->pause(std::max(*pause, kShortestPause), reading.stop))
      return unexpected(client::to_error(status, reading.stop));
  }
} catch (const std::bad_alloc&) {
  return unexpected(out_of_memory());
}

}  // namespace marble
