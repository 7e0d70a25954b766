// Bearer tokens: a file of salted hashes, never the tokens themselves. One a line:
//   NAME ROLE[,ROLE...] sha256:SALT:HASH        salt and SHA-256(salt, token) in hexadecimal digits
// Empty lines and lines that begin with # are left out. A name may have several tokens.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/identity.h"
#include "marble/error.h"

namespace marble::server {

struct Token {
  std::string client;
  Roles roles;
  std::string salt, hash;  ///< bytes
  [[nodiscard]] bool operator==(const Token&) const = default;
};

struct LineFault {
  int line;
  Error error;
};

/// The tokens of a file's text. Faults quote nothing of it: what is out of place may be a secret.
[[nodiscard]] std::vector<Token> parse_tokens(const std::string& text, std::vector<LineFault>& faults);

/// The token whose secret this is, else null. Takes as long whichever it is, and if it is none.
[[nodiscard]] const Token* find_token(const std::vector<Token>& tokens, std::string_view secret);

struct NewToken {
  std::string secret;  ///< 256 random bits as hexadecimal digits
  std::string line;    ///< for the file
};

/// Makes a token. `name_and_roles` is "NAME:ROLE[,ROLE...]".
[[nodiscard]] Expected<NewToken> new_token(const std::string& name_and_roles);

}  // namespace marble::server
