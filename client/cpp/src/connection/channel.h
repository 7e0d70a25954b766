// Provides the gRPC channel behind a client.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/security/credentials.h>

#include <memory>

#include "connection/target.h"
#include "marble/connect_options.h"
#include "marble/error.h"

namespace marble::client {

/// Creates the channel; does not connect yet. Errors: those of make_credentials.
[[nodiscard]] Expected<std::shared_ptr<grpc::Channel>> open_channel(const Target& target,
                                                                    const ConnectOptions& options);

// Provides the encryption of a channel.
[[nodiscard]] bool wants_tls(const ConnectOptions& options);

/// Returns plaintext credentials unless `options` request TLS. Errors name the tls_ field: a file that cannot
/// be read or is not PEM, a certificate without its key.
[[nodiscard]] Expected<std::shared_ptr<grpc::ChannelCredentials>> make_credentials(
    const ConnectOptions& options);

}  // namespace marble::client
