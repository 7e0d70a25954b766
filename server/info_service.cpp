#include "info_service.h"

#include "admission.h"
#include "server_info.h"
#include "status.h"

namespace marble::server {

grpc::ServerUnaryReactor* InfoService::GetInfo(grpc::CallbackServerContext* context,
                                               const v1::GetInfoRequest*, v1::GetInfoResponse* response) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  Origin origin = origin_of(*context);
  const auto identity = identify(parts_, *context, origin);
  if (!identity) {
    reactor->Finish(to_status(identity.error()));
    return reactor;
  }
  fill_info(parts_, *identity, response);
  reactor->Finish(grpc::Status::OK);
  return reactor;
}

}  // namespace marble::server
