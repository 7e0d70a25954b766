// The server's information about itself, for gRPC and for HTTP.
#pragma once

#include "base/identity.h"
#include "marble/v1/service.pb.h"

namespace marble::server {

struct ServiceParts;

void fill_counters(const ServiceParts& parts, v1::Counters* message);
void fill_info(const ServiceParts& parts, const Identity& caller, v1::GetInfoResponse* response);

}  // namespace marble::server
