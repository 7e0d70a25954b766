// The service marble.v1.Server: information about this server.
#pragma once

#include "marble/v1/service.grpc.pb.h"
#include "service/service_parts.h"

namespace marble::server {

using InfoRawService = v1::Server::WithRawCallbackMethod_GetInfo<v1::Server::Service>;

/// The method reads and writes bytes; see wire.h.
class InfoService final : public InfoRawService {
 public:
  explicit InfoService(const ServiceParts& parts) : parts_(parts) {}

  grpc::ServerUnaryReactor* GetInfo(grpc::CallbackServerContext* context, const grpc::ByteBuffer* request,
                                    grpc::ByteBuffer* response) override;

 private:
  const ServiceParts& parts_;
};

}  // namespace marble::server
