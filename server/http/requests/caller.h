// Who sends an HTTP request. The rules are those of gRPC calls: access.h.
#pragma once

#include <httplib.h>

#include "access/access.h"

namespace marble::server::http {

/// From "Authorization: Bearer TOKEN", the client's certificate, "Marble-Client: NAME" and the address.
[[nodiscard]] Credentials credentials_of(const httplib::Request& request);

}  // namespace marble::server::http
