// libpq, loaded at its first use: a server without a store in PostgreSQL needs neither it nor the twenty
// libraries that it depends on.
#pragma once

#include <libpq-fe.h>

#include "marble/error.h"

namespace marble::server {

#define MARBLE_LIBPQ(FUNCTION)   \
  FUNCTION(PQclear)              \
  FUNCTION(PQcmdTuples)          \
  FUNCTION(PQconnectPoll)        \
  FUNCTION(PQconnectStartParams) \
  FUNCTION(PQconninfoFree)       \
  FUNCTION(PQconninfoParse)      \
  FUNCTION(PQconsumeInput)       \
  FUNCTION(PQenterPipelineMode)  \
  FUNCTION(PQerrorMessage)       \
  FUNCTION(PQfinish)             \
  FUNCTION(PQflush)              \
  FUNCTION(PQfreemem)            \
  FUNCTION(PQgetResult)          \
  FUNCTION(PQgetlength)          \
  FUNCTION(PQgetvalue)           \
  FUNCTION(PQisBusy)             \
  FUNCTION(PQnotifies)           \
  FUNCTION(PQntuples)            \
  FUNCTION(PQpipelineSync)       \
  FUNCTION(PQresultErrorField)   \
  FUNCTION(PQresultErrorMessage) \
  FUNCTION(PQresultStatus)       \
  FUNCTION(PQsendQueryParams)    \
  FUNCTION(PQsetNoticeProcessor) \
  FUNCTION(PQsetnonblocking)     \
  FUNCTION(PQsocket)             \
  FUNCTION(PQstatus)

/// Its functions by name. All are null unless `loaded`.
struct Libpq {
#define MARBLE_FIELD(name) decltype(&::name) name = nullptr;
  MARBLE_LIBPQ(MARBLE_FIELD)
#undef MARBLE_FIELD
  /// Errors: failed_precondition, naming the package that contains it.
  Expected<void> loaded;
};

/// Loads it at the first call. Thread-safe.
[[nodiscard]] const Libpq& libpq();

}  // namespace marble::server
