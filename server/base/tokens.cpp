#include "base/tokens.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/rand.h>

#include <algorithm>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "marble/contract.h"

namespace marble::server {
namespace {

constexpr std::size_t kHashBytes = 32;
constexpr std::size_t kSaltBytes = 16;
constexpr std::size_t kSecretBytes = 32;
constexpr const char* kDigits = "0123456789abcdef";

std::string hash_of(std::string_view salt, std::string_view secret) {
  std::string hash(kHashBytes, '\0');
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  const bool done = context != nullptr && EVP_DigestInit_ex(context, EVP_sha256(), nullptr) == 1 &&
                    EVP_DigestUpdate(context, salt.data(), salt.size()) == 1 &&
                    EVP_DigestUpdate(context, secret.data(), secret.size()) == 1 &&
                    EVP_DigestFinal_ex(context, reinterpret_cast<unsigned char*>(hash.data()), nullptr) == 1;
  EVP_MD_CTX_free(context);
  if (!done) throw std::runtime_error("no SHA-256");  // an empty hash must match nothing
  return hash;
}

std::string to_hex(std::string_view bytes) {
  std::string text;
  for (const char byte : bytes) {
    const auto value = static_cast<unsigned char>(byte);
    text += kDigits[value >> 4U];
    text += kDigits[value & 15U];
  }
  return text;
}

std::optional<std::string> from_hex(std::string_view text) {
  const std::string_view digits(kDigits);
  if (text.size() % 2 != 0) return std::nullopt;
  std::string bytes;
  for (std::size_t i = 0; i < text.size(); i += 2) {
    const auto high = digits.find(text[i]), low = digits.find(text[i + 1]);
    if (high == std::string_view::npos || low == std::string_view::npos) return std::nullopt;
    bytes += static_cast<char>(high * 16 + low);
  }
  return bytes;
}

std::string random_bytes(std::size_t count) {
  std::string bytes(count, '\0');
  if (RAND_bytes(reinterpret_cast<unsigned char*>(bytes.data()), static_cast<int>(count)) != 1)
    throw std::runtime_error("no random numbers");
  return bytes;
}

Expected<void> check_name(std::string_view name) {
  const auto printable = [](char c) { return c > ' ' && c <= '~'; };
  if (name.empty() || name.size() > contract::longest_client_name || name[0] == '#' ||
      !std::all_of(name.begin(), name.end(), printable))
    return unexpected(invalid("name", "must have 1 to 64 bytes of printable ASCII"));
  if (name.rfind(kCertificatePrefix, 0) == 0)
    return unexpected(invalid("name", "must not begin with cert: as those of certificates do"));
  return {};
}

Expected<Roles> roles_of(const std::string& text) {
  Roles roles;
  std::istringstream names(text);
  for (std::string name; std::getline(names, name, ',');) {
    const auto role = role_of(name);
    if (!role) return unexpected(invalid("roles", "must be of solve, observe, admin, with commas between"));
    roles.add(*role);
  }
  return roles;
}

Expected<Token> token_of(const std::string& line) {
  std::istringstream words(line);
  std::string name, roles_text, key, rest;
  words >> name >> roles_text >> key;
  if (key.empty() || words >> rest)
    return unexpected(failure(ErrorCode::invalid_argument, "must be NAME ROLE[,ROLE...] sha256:SALT:HASH"));
  MARBLE_RETURN_IF_ERROR(check_name(name));
  MARBLE_ASSIGN_OR_RETURN(const auto roles, roles_of(roles_text));
  const std::string_view prefix = "sha256:";
  const std::size_t colon = key.rfind(':');
  if (key.rfind(prefix, 0) != 0 || colon < prefix.size())
    return unexpected(invalid("hash", "must be sha256:SALT:HASH"));
  const auto salt = from_hex(std::string_view(key).substr(prefix.size(), colon - prefix.size()));
  const auto hash = from_hex(std::string_view(key).substr(colon + 1));
  if (!salt || !hash || salt->empty() || hash->size() != kHashBytes)
    return unexpected(invalid("hash", "must have a salt, and 64 digits of hash, in lower-case hexadecimal"));
  return Token{name, roles, *salt, *hash};
}

}  // namespace

std::vector<Token> parse_tokens(const std::string& text, std::vector<LineFault>& faults) {
  std::vector<Token> tokens;
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const std::size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string::npos || line[begin] == '#') continue;
    auto token = token_of(line);
    if (token) {
      tokens.push_back(*std::move(token));
    } else {
      faults.push_back({number, std::move(token).error()});
    }
  }
  return tokens;
}

const Token* find_token(const std::vector<Token>& tokens, std::string_view secret) {
  const Token* found = nullptr;
  for (const Token& token : tokens) {
    const std::string hash = hash_of(token.salt, secret);
    if (CRYPTO_memcmp(hash.data(), token.hash.data(), kHashBytes) == 0) found = &token;
  }
  return found;
}

Expected<NewToken> new_token(const std::string& name_and_roles) {
  const std::size_t colon = name_and_roles.rfind(':');
  const std::string name = name_and_roles.substr(0, colon);
  if (colon == std::string::npos || colon + 1 == name_and_roles.size())
    return unexpected(invalid("new-token", "must be NAME:ROLE[,ROLE...]"));
  MARBLE_RETURN_IF_ERROR(check_name(name));
  const std::string roles_text = name_and_roles.substr(colon + 1);
  MARBLE_RETURN_IF_ERROR(roles_of(roles_text));
  const std::string secret = to_hex(random_bytes(kSecretBytes));
  const std::string salt = random_bytes(kSaltBytes);
  return NewToken{secret,
                  name + " " + roles_text + " sha256:" + to_hex(salt) + ":" + to_hex(hash_of(salt, secret))};
}

}  // namespace marble::server
