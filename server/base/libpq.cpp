#include "base/libpq.h"

#include <dlfcn.h>

#include <string>

namespace marble::server {
namespace {

Libpq load() {
  Libpq library;
  void* const handle = dlopen("libpq.so.5", RTLD_NOW | RTLD_LOCAL);
  bool whole = handle != nullptr;
#define MARBLE_LOAD(name) \
  if (whole)              \
    whole = (library.name = reinterpret_cast<decltype(library.name)>(dlsym(handle, #name))) != nullptr;
  MARBLE_LIBPQ(MARBLE_LOAD)
#undef MARBLE_LOAD
  if (whole) return library;
  const char* const why = dlerror();
  Libpq none;
  none.loaded = unexpected(failure(ErrorCode::failed_precondition, "state", "libpq.so.5",
                                   "PostgreSQL's library of version 14 or newer is missing, Debian's package "
                                   "libpq5: " +
                                       std::string(why == nullptr ? "" : why)));
  return none;
}

}  // namespace

const Libpq& libpq() {
  static const Libpq library = load();
  return library;
}

}  // namespace marble::server
