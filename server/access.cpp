#include "access.h"

#include <algorithm>

namespace marble::server {
namespace {

template <class Number>
Number or_none(Number limit) {
  return limit > 0 ? limit : std::numeric_limits<Number>::max();
}

Priority priority_of(const std::string& name) {
  const auto found = std::find(kPriorityNames.begin(), kPriorityNames.end(), name);
  return static_cast<Priority>(found - kPriorityNames.begin());
}

}  // namespace

Access::Access(const Config& config)
    : default_quota_{or_none(config.client_running), or_none(config.client_queued),
                     or_none(config.client_sessions), or_none(config.client_bytes),
                     priority_of(config.client_priority)} {}

Expected<Identity> Access::identify(const grpc::CallbackServerContext& context) const {
  return Identity{context.peer(), Roles::all()};
}

Expected<Identity> Access::require(const grpc::CallbackServerContext& context, Role role) const {
  auto identity = identify(context);
  if (identity && !identity->roles.has(role))
    return unexpected(Error{ErrorCode::permission_denied, "", -1, "", "the role is missing"});
  return identity;
}

Quota Access::quota_of(const std::string& /*client*/) const { return default_quota_; }

}  // namespace marble::server
