#include "info_service.h"

#include "reply.h"
#include "server_info.h"
#include "status.h"

namespace marble::server {

grpc::ServerUnaryReactor* InfoService::GetInfo(grpc::CallbackServerContext* context,
                                               const v1::GetInfoRequest*, v1::GetInfoResponse* response) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  const auto identity = parts_.access.identify(*context);
  if (!identity) {
    log_refusal(parts_.log, context->peer(), "", identity.error());
    reactor->Finish(to_status(identity.error()));
    return reactor;
  }
  fill_info(parts_, *identity, response);
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace marble::server
