// The daemon uses jemalloc: workers free what gRPC's threads allocate, which is slower with glibc's arenas
// (a request with a tiny problem takes a tenth to a fifth less time).
#include <jemalloc/jemalloc.h>

/// Read by jemalloc at its start: returns the memory left by a large solve to the system while there are no
/// calls.
const char* malloc_conf = "background_thread:true";
