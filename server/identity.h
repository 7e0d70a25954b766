// Who a call comes from, and what it may do.
#pragma once

#include <string>

namespace marble::server {

enum class Role { solve, observe, admin };

/// A set of roles.
class Roles {
 public:
  constexpr Roles() = default;
  [[nodiscard]] constexpr bool has(Role role) const { return (bits_ & bit(role)) != 0; }
  constexpr void add(Role role) { bits_ |= bit(role); }
  [[nodiscard]] static constexpr Roles all() {
    Roles roles;
    for (const Role role : {Role::solve, Role::observe, Role::admin}) roles.add(role);
    return roles;
  }

 private:
  [[nodiscard]] static constexpr unsigned bit(Role role) { return 1U << static_cast<unsigned>(role); }
  unsigned bits_ = 0;
};

struct Identity {
  std::string client;  ///< name of its token or certificate, else the one it gave itself, else its address
  Roles roles;
};

}  // namespace marble::server
