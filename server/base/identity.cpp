#include "base/identity.h"

namespace marble::server {

Expected<Role> role_of(std::string_view name) {
  for (const Role role : {Role::solve, Role::observe, Role::admin}) {
    if (name == to_string(role)) return role;
  }
  return unexpected(invalid("roles", std::string(name), "must be solve, observe or admin"));
}

std::vector<std::string> Roles::names() const {
  std::vector<std::string> result;
  for (const Role role : {Role::solve, Role::observe, Role::admin}) {
    if (has(role)) result.emplace_back(to_string(role));
  }
  return result;
}

}  // namespace marble::server
