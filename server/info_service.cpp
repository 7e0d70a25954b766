#include "info_service.h"

#include "marble/convert.h"
#include "marble/version.h"

namespace marble::server {

grpc::ServerUnaryReactor* InfoService::GetInfo(grpc::CallbackServerContext* context,
                                               const v1::GetInfoRequest*, v1::GetInfoResponse* response) {
  response->set_version(kVersion);
  response->set_workers(scheduler_.limits().workers);
  response->mutable_limits()->set_message_bytes(config_.message_bytes);
  response->mutable_limits()->set_queue_jobs(config_.queue_jobs);
  response->mutable_limits()->set_queue_bytes(config_.queue_bytes);
  for (const OptionInfo& option : option_table()) to_message(option, response->add_options());
  const Counters counters = scheduler_.counters();
  v1::Counters* message = response->mutable_counters();
  message->set_accepted_total(counters.accepted);
  message->set_answered_total(counters.answered);
  message->set_solved_total(counters.solved);
  message->set_refused_total(counters.refused);
  message->set_cancelled_total(counters.cancelled);
  message->set_failed_total(counters.failed);
  message->set_queued(counters.queued);
  message->set_running(counters.running);
  response->set_uptime_s(std::chrono::duration<double>(Clock::now() - start_).count());
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace marble::server
