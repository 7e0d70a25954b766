// What keeps pages of other sites out: a browser sends requests for anybody, and from inside the user's
// network.
#pragma once

#include <httplib.h>

#include "marble/error.h"

namespace marble::server::http {

/// Sent with every answer: no other site embeds, reads or runs anything of it.
[[nodiscard]] httplib::Headers safety_headers();

/// Where `is_local`, the port is on loopback and takes callers for what they say: then a name that is not
/// loopback's own means that another site's name was made to point here. Errors: permission_denied (the
/// header Host, Sec-Fetch-Site, or none that only this site's page can send with a POST: Marble-Request, or a
/// Content-Type that no form has).
[[nodiscard]] Expected<void> check_browser(const httplib::Request& request, bool is_local);

/// Whether its body is said to be JSON.
[[nodiscard]] bool is_json(const httplib::Request& request);

/// Of a Host header or an address to listen at, with or without a port.
[[nodiscard]] bool is_loopback(const std::string& host);

}  // namespace marble::server::http
