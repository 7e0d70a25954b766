// Provides the encryption of a channel.
#pragma once

#include <grpcpp/security/credentials.h>

#include <memory>

#include "marble/connect_options.h"
#include "marble/error.h"

namespace marble::client {

[[nodiscard]] bool wants_tls(const ConnectOptions& options);

/// Returns plaintext credentials unless `options` request TLS. Errors name the tls_ field: a file that cannot
/// be read or is not PEM, a certificate without its key.
[[nodiscard]] Expected<std::shared_ptr<grpc::ChannelCredentials>> make_credentials(
    const ConnectOptions& options);

}  // namespace marble::client
