#include "access/certificate_keeper.h"

namespace marble::server {

std::shared_ptr<const Certificates> CertificateKeeper::look() {
  const MutexLock lock(mutex_);
  const auto read = read_certificates(settings_);
  if (!read) {
    // Once, not at every handshake.
    const std::string fault = read.error().message();
    if (fault != last_fault_)
      log_.error(Component::tls, "certificate_refused", {{"address", address_}, {"reason", fault}});
    last_fault_ = fault;
    return in_force_;
  }
  last_fault_.clear();
  if (in_force_ != nullptr && *read == *in_force_) return in_force_;
  in_force_ = std::make_shared<const Certificates>(*read);
  if (is_expired(*in_force_)) {
    log_.warn(Component::tls, "certificate_expired",
              {{"address", address_}, {"valid_until", expiry_of(*in_force_)}});
  } else {
    log_.info(Component::tls, "certificate", {{"address", address_}, {"valid_until", expiry_of(*in_force_)}});
  }
  return in_force_;
}

}  // namespace marble::server
