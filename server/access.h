// Who may call, and what each caller may use.
#pragma once

#include <grpcpp/server_context.h>

#include "config.h"
#include "identity.h"
#include "marble/error.h"
#include "quota.h"

namespace marble::server {

/// Thread-safe.
class Access {
 public:
  explicit Access(const Config& config);

  /// Who calls. Errors: unauthenticated.
  [[nodiscard]] Expected<Identity> identify(const grpc::CallbackServerContext& context) const;
  /// Who calls, if it has the role. Errors: unauthenticated, permission_denied.
  [[nodiscard]] Expected<Identity> require(const grpc::CallbackServerContext& context, Role role) const;
  /// What the client may use.
  [[nodiscard]] Quota quota_of(const std::string& client) const;

 private:
  Quota default_quota_;
};

}  // namespace marble::server
