// Identifies callers, and determines what each may use.
#pragma once

#include <grpcpp/server_context.h>

#include <atomic>
#include <memory>
#include <optional>
#include <string>

#include "base/identity.h"
#include "base/quota.h"
#include "config/config.h"
#include "marble/error.h"
#include "mutex.h"

namespace marble::server {

/// What a call contains about its caller.
struct Credentials {
  std::string peer;                        ///< gRPC's address of it
  std::optional<std::string> token;        ///< from "authorization: Bearer TOKEN"
  std::optional<std::string> certificate;  ///< name in its verified certificate
  std::optional<std::string> name;         ///< from "marble-client: NAME"
};

/// Returns the token in the value of an authorization header; empty if it is not a bearer token.
[[nodiscard]] std::optional<std::string> bearer_of(const std::string& authorization);

[[nodiscard]] Credentials credentials_of(const grpc::CallbackServerContext& context);

/// Thread-safe.
class Access {
 public:
  explicit Access(const Config& config);

  /// Applies the tokens, roles and quotas of this configuration to calls from now on.
  void reload(const Config& config) ABSL_LOCKS_EXCLUDED(mutex_);

  /// Identifies the caller. Errors: unauthenticated; invalid_argument (an invalid name).
  [[nodiscard]] Expected<Identity> identify(const grpc::CallbackServerContext& context) const;
  [[nodiscard]] Expected<Identity> identify(const Credentials& given) const ABSL_LOCKS_EXCLUDED(mutex_);
  /// True if identify() would succeed; counts no refusal.
  [[nodiscard]] bool is_known(const grpc::CallbackServerContext& context) const ABSL_LOCKS_EXCLUDED(mutex_);
  /// The same for a call that needs a role. Errors: also permission_denied.
  [[nodiscard]] Expected<Identity> require(const grpc::CallbackServerContext& context, Role role) const;
  [[nodiscard]] Expected<Identity> require(const Credentials& given, Role role) const;
  /// True if callers are identified by tokens or certificates, not by the names they give.
  [[nodiscard]] bool knows_callers() const ABSL_LOCKS_EXCLUDED(mutex_);
  /// Number of refused callers so far.
  struct Refused {
    std::int64_t unauthenticated = 0, permission_denied = 0;
  };
  [[nodiscard]] Refused refused() const { return {unauthenticated_, permission_denied_}; }
  /// Returns the client's quota.
  [[nodiscard]] Quota quota_of(const std::string& client) const ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Rules;
  [[nodiscard]] static Expected<Identity> identity_of(const Rules& rules, const Credentials& given);
  [[nodiscard]] static std::shared_ptr<const Rules> rules_of(const Config& config);
  [[nodiscard]] std::shared_ptr<const Rules> rules() const ABSL_LOCKS_EXCLUDED(mutex_);

  mutable Mutex mutex_;
  std::shared_ptr<const Rules> rules_ ABSL_GUARDED_BY(mutex_);
  mutable std::atomic<std::int64_t> unauthenticated_ = 0, permission_denied_ = 0;
};

}  // namespace marble::server
