// Who sends an HTTP request. The rules are those of gRPC calls: access.h.
#pragma once

#include <httplib.h>

#include "access/access.h"
#include "access/origin.h"

namespace marble::server::http {

/// From "Authorization: Bearer TOKEN", the client's certificate, "Marble-Client: NAME" and the address.
[[nodiscard]] Credentials credentials_of(const httplib::Request& request);

/// Takes up the client's trace too: `traceparent`.
[[nodiscard]] Origin origin_of(const httplib::Request& request);

}  // namespace marble::server::http
