// marble.v1.Server: what this server is and does.
#pragma once

#include "access.h"
#include "config.h"
#include "log.h"
#include "marble/v1/service.grpc.pb.h"
#include "scheduler.h"

namespace marble::server {

class InfoService final : public v1::Server::CallbackService {
 public:
  InfoService(const Scheduler& scheduler, const Config& config, const Access& access, const Log& log)
      : scheduler_(scheduler), config_(config), access_(access), log_(log) {}

  grpc::ServerUnaryReactor* GetInfo(grpc::CallbackServerContext* context, const v1::GetInfoRequest* request,
                                    v1::GetInfoResponse* response) override;

 private:
  const Scheduler& scheduler_;
  const Config& config_;
  const Access& access_;
  const Log& log_;
  const Clock::time_point start_ = Clock::now();
};

}  // namespace marble::server
