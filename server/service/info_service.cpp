#include "service/info_service.h"

#include "service/server_info.h"
#include "service/unary_call.h"

namespace marble::server {

grpc::ServerUnaryReactor* InfoService::GetInfo(grpc::CallbackServerContext* context,
                                               const grpc::ByteBuffer* request, grpc::ByteBuffer* response) {
  const auto handle = [&](const Identity& caller, const v1::GetInfoRequest&, v1::GetInfoResponse* out,
                          const Origin&) -> Expected<void> {
    fill_info(parts_, caller, out);
    return {};
  };
  return answer<v1::GetInfoRequest, v1::GetInfoResponse>(parts_, context, request, response,
                                                         of_any_role(parts_, *context), handle);
}

}  // namespace marble::server
