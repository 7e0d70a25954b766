// A submitted job on its way in, and its end on demand.
#pragma once

#include "service/admission.h"
#include "service/unary_call.h"

namespace marble::server {

/// Takes the job in; where there is a store, the answer waits until it is on disk. A request by an id that
/// the client has used before, of a job that is still kept, is that job. Errors: what admission refuses;
/// unavailable (the store cannot write).
[[nodiscard]] Expected<Afterwards> submit(const ServiceParts& parts, const Caller& caller,
                                          std::shared_ptr<v1::SolveRequest> request,
                                          v1::SubmitResponse* response);

/// Asks for the end of any job; that of a submitted one is not forgotten by a restart.
[[nodiscard]] Expected<Afterwards> cancel_job(const ServiceParts& parts, const Identity& caller,
                                              const std::string& id, v1::CancelJobResponse* response);

/// What waits until all that the store was asked for is made; nothing where there is none.
[[nodiscard]] Afterwards when_settled(const ServiceParts& parts);

}  // namespace marble::server
