// The certificates that an address serves: those in the files while they are valid, else the last valid
// ones.
#pragma once

#include <memory>
#include <string>

#include "config/certificates.h"
#include "log/log.h"
#include "mutex.h"

namespace marble::server {

/// Thread-safe. Both references must outlive it.
class CertificateKeeper {
 public:
  CertificateKeeper(const Settings& settings, const Log& log, std::string address)
      : settings_(settings), log_(log), address_(std::move(address)) {}

  /// Reads the files and logs changes. Returns the same pointer while nothing has changed; null until they
  /// were valid once.
  [[nodiscard]] std::shared_ptr<const Certificates> look() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  const Settings& settings_;
  const Log& log_;
  const std::string address_;
  Mutex mutex_;
  std::shared_ptr<const Certificates> in_force_ ABSL_GUARDED_BY(mutex_);
  std::string last_fault_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace marble::server
