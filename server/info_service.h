// marble.v1.Server: what this server is and does.
#pragma once

#include "marble/v1/service.grpc.pb.h"
#include "service_parts.h"

namespace marble::server {

class InfoService final : public v1::Server::CallbackService {
 public:
  explicit InfoService(const ServiceParts& parts) : parts_(parts) {}

  grpc::ServerUnaryReactor* GetInfo(grpc::CallbackServerContext* context, const v1::GetInfoRequest* request,
                                    v1::GetInfoResponse* response) override;

 private:
  const ServiceParts& parts_;
};

}  // namespace marble::server
