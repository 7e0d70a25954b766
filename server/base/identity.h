// The caller of a request, and its roles.
#pragma once

#include <array>
#include <initializer_list>
#include <string>
#include <string_view>
#include <vector>

#include "marble/error.h"

namespace marble::server {

enum class Role { solve, observe, admin };
constexpr std::array<const char*, 3> kRoleNames = {"solve", "observe", "admin"};

[[nodiscard]] constexpr const char* to_string(Role role) {
  return kRoleNames[static_cast<std::size_t>(role)];
}
/// Returns the role of that name. Errors: invalid_argument, field "roles".
[[nodiscard]] Expected<Role> role_of(std::string_view name);

/// A set of roles.
class Roles {
 public:
  constexpr Roles() = default;
  constexpr Roles(std::initializer_list<Role> roles) {
    for (const Role role : roles) add(role);
  }
  [[nodiscard]] constexpr bool operator==(const Roles&) const = default;
  [[nodiscard]] constexpr bool has(Role role) const { return (bits_ & bit(role)) != 0; }
  constexpr void add(Role role) { bits_ |= bit(role); }
  [[nodiscard]] static constexpr Roles all() { return {Role::solve, Role::observe, Role::admin}; }
  /// Returns their names, in the order of Role.
  [[nodiscard]] std::vector<std::string> names() const;

 private:
  [[nodiscard]] static constexpr unsigned bit(Role role) { return 1U << static_cast<unsigned>(role); }
  unsigned bits_ = 0;
};

/// Prefix of the name in a client's certificate, so that no signer of certificates can use the name of a
/// token.
constexpr std::string_view kCertificatePrefix = "cert:";

struct Identity {
  std::string client;  ///< name of its token or certificate, else the name that it gives, else its address
  Roles roles;
};

}  // namespace marble::server
