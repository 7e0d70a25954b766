#include "replay/bundle_file.h"

#include "base/atomic_file.h"
#include "file_bytes.h"

namespace marble::cli {

Expected<void> save_bundle(const Bundle& bundle, const std::string& path) {
  return or_out_of_memory([&]() -> Expected<void> {
    MARBLE_ASSIGN_OR_RETURN(auto file, AtomicFile::open(path));
    auto written = write_bundle(bundle, [&](std::string_view bytes) -> Expected<void> {
      file.write(bytes);
      return {};
    });
    return written ? file.commit() : written;
  });
}

Expected<void> save_bundle(const JobBundle& parts, const std::string& path) {
  Bundle bundle{{}, parts.request, parts.answer};
  if (!bundle.facts.ParseFromString(parts.facts))
    return unexpected(failure(ErrorCode::internal, "the server's bundle cannot be read"));
  return save_bundle(bundle, path);
}

Expected<Bundle> load_bundle(const std::string& path) {
  return or_out_of_memory([&]() -> Expected<Bundle> {
    MARBLE_ASSIGN_OR_RETURN(const auto bytes, formats::read_bytes(path));
    return read_bundle(bytes);
  });
}

}  // namespace marble::cli
