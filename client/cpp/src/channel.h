// The gRPC channel behind a client.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "marble/connect_options.h"
#include "marble/error.h"

namespace marble::client {

/// Does not connect yet. Errors: those of target_of and make_credentials.
[[nodiscard]] Expected<std::shared_ptr<grpc::Channel>> open_channel(const std::string& address,
                                                                    const ConnectOptions& options);

}  // namespace marble::client
