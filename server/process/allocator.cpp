// The daemon's allocator is jemalloc: what gRPC's threads allocate, workers free, which costs glibc's arenas
// more (a request of a tiny problem takes a tenth to a fifth less time).
#include <jemalloc/jemalloc.h>

/// Read by jemalloc as it starts: memory that a large solve has left goes back to the system while nobody
/// calls.
const char* malloc_conf = "background_thread:true";
