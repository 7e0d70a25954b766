// Bearer tokens: a file of salted hashes, never the tokens themselves. One per line:
//   NAME ROLE[,ROLE...] sha256:SALT:HASH        salt and SHA-256(salt, token) in hexadecimal digits
// Empty lines and lines that begin with # are ignored. A name may have several tokens.
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

/// Returns the tokens of a file's text. Errors quote none of it: misplaced text may be a secret.
[[nodiscard]] std::vector<Token> parse_tokens(const std::string& text, std::vector<LineFault>& faults);

/// Returns the token with this secret, else null. Takes the same time for every token, and if there is none.
[[nodiscard]] const Token* find_token(const std::vector<Token>& tokens, std::string_view secret);

struct NewToken {
  std::string secret;  ///< 256 random bits as hexadecimal digits
  std::string line;    ///< line for the file
};

/// Makes a token. `name_and_roles` is "NAME:ROLE[,ROLE...]".
[[nodiscard]] Expected<NewToken> new_token(const std::string& name_and_roles);

}  // namespace marble::server
