// A submitted job as a replay bundle: what it was asked, what it was solved by, what came of it.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "base/identity.h"
#include "bundle.h"
#include "service/service_parts.h"

namespace marble::server {

/// Counted among `bundles`, and those of its client, until it is let go.
using GatheredBundle = std::shared_ptr<const Bundle>;

/// Gathers it, and tells it or why there is none, on whatever thread has the last part. Errors: not_found,
/// permission_denied (who may see the job, and is neither its client nor has the role admin),
/// failed_precondition (a job that was not submitted, or whose request is not kept any more),
/// resource_exhausted (`bundles`, `client_bundles`), unavailable.
void gather_bundle(const ServiceParts& parts, const Identity& caller, const std::string& id,
                   const std::function<void(Expected<GatheredBundle>)>& then);

}  // namespace marble::server
