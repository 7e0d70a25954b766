// Identifies the sender of an HTTP request, by the rules of gRPC calls: access.h.
#pragma once

#include <httplib.h>

#include "access/access.h"
#include "base/origin.h"

namespace marble::server::http {

/// From "Authorization: Bearer TOKEN", the client's certificate, "Marble-Client: NAME" and the address.
[[nodiscard]] Credentials credentials_of(const httplib::Request& request);

/// Also reads the client's trace: `traceparent`.
[[nodiscard]] Origin origin_of(const httplib::Request& request);

}  // namespace marble::server::http
