// A submitted job as a replay bundle: its request, its solver and its result.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "base/identity.h"
#include "bundle.h"
#include "service/service_parts.h"

namespace marble::server {

/// Counts towards `bundles`, and those of its client, until it is released.
using GatheredBundle = std::shared_ptr<const Bundle>;

/// Gathers the bundle, and calls back with it or with an error, on the thread that has the last part.
/// Errors: not_found, permission_denied (the caller may see the job, but is neither its client nor has the
/// role admin), failed_precondition (a job that was not submitted, or whose request is no longer kept),
/// resource_exhausted (`bundles`, `client_bundles`), unavailable.
void gather_bundle(const ServiceParts& parts, const Identity& caller, const std::string& id,
                   const std::function<void(Expected<GatheredBundle>)>& then);

}  // namespace marble::server
