#include "config/state_uri.h"

#include <libpq-fe.h>

#include <memory>
#include <string_view>

namespace marble::server {
namespace {

struct FreeOptions {
  void operator()(PQconninfoOption* options) const { PQconninfoFree(options); }
};

}  // namespace

// Its value is in no error: it may hold a password.
Expected<void> check_state_uri(const std::string& uri) {
  if (!uri.starts_with("postgresql://")) return unexpected(invalid("state", "must begin with postgresql://"));
  char* why = nullptr;
  const std::unique_ptr<PQconninfoOption, FreeOptions> options(PQconninfoParse(uri.c_str(), &why));
  PQfreemem(why);
  if (options == nullptr) return unexpected(invalid("state", "is no address of PostgreSQL"));
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val != nullptr && std::string_view(option->keyword) == "password")
      return unexpected(
          invalid("state", "must hold no password: give it by PGPASSWORD, or in the file of passfile="));
  }
  return {};
}

}  // namespace marble::server
