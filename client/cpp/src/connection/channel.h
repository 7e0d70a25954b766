// Provides the gRPC channel behind a client.
#pragma once

#include <grpcpp/channel.h>

#include <memory>

#include "connection/target.h"
#include "marble/connect_options.h"
#include "marble/error.h"

namespace marble::client {

/// Creates the channel; does not connect yet. Errors: those of make_credentials.
[[nodiscard]] Expected<std::shared_ptr<grpc::Channel>> open_channel(const Target& target,
                                                                    const ConnectOptions& options);

}  // namespace marble::client
