// SHA-256.
#pragma once

#include <openssl/sha.h>

#include <string>

namespace marble::server {

[[nodiscard]] inline std::string digest_of(const std::string& bytes) {
  std::string digest(SHA256_DIGEST_LENGTH, '\0');
  SHA256(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(),
         reinterpret_cast<unsigned char*>(digest.data()));
  return digest;
}

}  // namespace marble::server
