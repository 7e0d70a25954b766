// The gRPC channel behind a client.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "marble/connect_options.h"
#include "marble/error.h"

namespace marble::client {

/// Accepts host:port, unix:PATH and what else ends in a port. The error's field is "address".
[[nodiscard]] Expected<void> check_address(const std::string& address);

/// Does not connect yet. Errors: those of make_credentials.
[[nodiscard]] Expected<std::shared_ptr<grpc::Channel>> open_channel(const std::string& address,
                                                                    const ConnectOptions& options);

}  // namespace marble::client
