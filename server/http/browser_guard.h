// Protects against pages of other sites: a browser sends requests for any site, and from inside the user's
// network.
#pragma once

#include <httplib.h>

#include "marble/error.h"

namespace marble::server::http {

/// Sent with every reply: no other site may embed, read or run its contents.
[[nodiscard]] httplib::Headers safety_headers();

/// `is_local` means that the port is on loopback and trusts the names that callers give: a host that is not
/// a loopback name then shows that another site's name was made to point here. Errors: permission_denied
/// (the header Host, Sec-Fetch-Site, or a POST without a header that only this site's page can send:
/// Marble-Request, or a Content-Type that no form has).
[[nodiscard]] Expected<void> check_browser(const httplib::Request& request, bool is_local);

/// True if the Content-Type of its body is JSON.
[[nodiscard]] bool is_json(const httplib::Request& request);

/// Of a Host header or a listening address, with or without a port.
[[nodiscard]] bool is_loopback(const std::string& host);

}  // namespace marble::server::http
