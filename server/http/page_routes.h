// The page and what it needs, from the binary: / and /assets/NAME.
#pragma once

#include "http/requests/router.h"

namespace marble::server::http {

void add_page_routes(Router& router);

}  // namespace marble::server::http
