#include "base/state_uri.h"

#include <memory>
#include <string_view>

#include "base/libpq.h"

namespace marble::server {
namespace {

struct FreeOptions {
  void operator()(PQconninfoOption* options) const { libpq().PQconninfoFree(options); }
};

}  // namespace

// No error contains the value: it may include a password.
Expected<void> check_state_uri(const std::string& uri) {
  if (!uri.starts_with("postgresql://")) return unexpected(invalid("state", "must begin with postgresql://"));
  if (!libpq().loaded) return libpq().loaded;
  char* why = nullptr;
  const std::unique_ptr<PQconninfoOption, FreeOptions> options(libpq().PQconninfoParse(uri.c_str(), &why));
  libpq().PQfreemem(why);
  if (options == nullptr) return unexpected(invalid("state", "is no address of PostgreSQL"));
  for (const PQconninfoOption* option = options.get(); option->keyword != nullptr; ++option) {
    if (option->val == nullptr || std::string_view(option->dispchar) != "*")
      continue;  // libpq's mark of a secret
    const std::string name = option->keyword;
    return unexpected(invalid(
        "state", "must hold no " + name +
                     (name == "password" ? ": give it by PGPASSWORD, or in the file of passfile="
                                         : ": nobody but the server may read the file, without one")));
  }
  return {};
}

}  // namespace marble::server
