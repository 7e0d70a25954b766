// Which jobs a caller may see and end.
#pragma once

#include "base/identity.h"
#include "jobs/job_board.h"

namespace marble::server {

[[nodiscard]] inline bool may_see(const Identity& caller, const std::string& owner) {
  return caller.client == owner || caller.roles.has(Role::observe) || caller.roles.has(Role::admin);
}
[[nodiscard]] inline bool may_end(const Identity& caller, const std::string& owner) {
  return caller.client == owner || caller.roles.has(Role::admin);
}

/// The same whether the job does not exist or the caller may not know of it.
[[nodiscard]] inline Error no_such_job(const std::string& id) {
  return failure(ErrorCode::not_found, "job_id", id, "is no job that is remembered");
}

/// Returns the job, if the caller may see it.
[[nodiscard]] inline Expected<std::shared_ptr<JobRecord>> find_job(const JobBoard& board,
                                                                   const Identity& caller,
                                                                   const std::string& id) {
  auto record = board.find(id);
  if (record == nullptr || !may_see(caller, record->description().client)) return unexpected(no_such_job(id));
  return record;
}

/// Returns permission_denied, for a caller who may see the job but not end it.
[[nodiscard]] inline Error not_to_end(const std::string& id) {
  return failure(ErrorCode::permission_denied, "job_id", id,
                 "is another client's job; ending it needs the role admin");
}

}  // namespace marble::server
