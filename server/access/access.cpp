#include "access/access.h"

#include <grpc/grpc_security_constants.h>

#include <algorithm>
#include <map>
#include <vector>

#include "base/origin.h"
#include "config/certificates.h"
#include "marble/contract.h"

namespace marble::server {
namespace {

constexpr Roles kCertificateRoles = {Role::solve, Role::observe};  // of a client without roles in the file

// Returns a client's entry in a table: under its own name, or under the name in its certificate.
template <class Value>
const Value* find(const std::map<std::string, Value>& table, const std::string& client) {
  auto found = table.find(client);
  if (found == table.end() && client.rfind(kCertificatePrefix, 0) == 0)
    found = table.find(client.substr(kCertificatePrefix.size()));
  return found == table.end() ? nullptr : &found->second;
}

Error unauthenticated(const char* reason) { return failure(ErrorCode::unauthenticated, reason); }

template <class Number>
Number or_none(Number limit) {
  return limit > 0 ? limit : std::numeric_limits<Number>::max();
}

// -1 stands for a quarter, so that no single client can use everything.
int share_of(int whole, int limit) { return limit < 0 ? std::max(1, whole / 4) : or_none(limit); }

Quota quota_of_settings(const Settings& settings) {
  const auto priority = std::find(kPriorityNames.begin(), kPriorityNames.end(), settings.client_priority) -
                        kPriorityNames.begin();
  return {or_none(settings.client_running),
          share_of(settings.queue_jobs, settings.client_queued),
          share_of(settings.sessions, settings.client_sessions),
          share_of(settings.watchers, settings.client_watchers),
          share_of(settings.bundles, settings.client_bundles),
          or_none(settings.client_bytes),
          static_cast<Priority>(priority)};
}

std::optional<std::string> metadata(const grpc::CallbackServerContext& context, const char* key) {
  const auto found = context.client_metadata().find(key);
  if (found == context.client_metadata().end()) return std::nullopt;
  return std::string(found->second.data(), found->second.size());
}

std::optional<std::string> certificate_name(const grpc::CallbackServerContext& context) {
  const auto authentication = context.auth_context();
  if (authentication == nullptr || !authentication->IsPeerAuthenticated()) return std::nullopt;
  for (const char* property :
       {GRPC_PEER_DNS_PROPERTY_NAME, GRPC_PEER_URI_PROPERTY_NAME, GRPC_X509_CN_PROPERTY_NAME}) {
    const auto values = authentication->FindPropertyValues(property);
    if (!values.empty() && !values[0].empty()) return std::string(values[0].data(), values[0].size());
  }
  return std::nullopt;
}

Expected<std::string> own_name(const std::string& name) {
  const bool printable =
      std::all_of(name.begin(), name.end(), [](unsigned char c) { return c >= 0x20 && c < 0x7f; });
  if (!name.empty() && name.size() <= contract::longest_client_name && printable) return name;
  return unexpected(invalid(
      "marble-client", std::to_string(name.size()) + " bytes",
      "must have 1 to " + std::to_string(contract::longest_client_name) + " bytes of printable ASCII"));
}

}  // namespace

struct Access::Rules {
  bool tokens_known = false, certificates_known = false;  // how callers are identified
  std::vector<Token> tokens;
  std::map<std::string, Roles> roles;
  std::map<std::string, Quota> quotas;
  Quota default_quota;
};

std::optional<std::string> bearer_of(const std::string& authorization) {
  const std::string scheme = "bearer ";
  const auto same = [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? b - 'A' + 'a' : b); };
  if (authorization.size() < scheme.size() ||
      !std::equal(scheme.begin(), scheme.end(), authorization.begin(), same))
    return std::nullopt;
  const std::size_t begin = authorization.find_first_not_of(' ', scheme.size());
  return begin == std::string::npos ? "" : authorization.substr(begin);
}

Credentials credentials_of(const grpc::CallbackServerContext& context) {
  Credentials given{context.peer(), std::nullopt, certificate_name(context),
                    metadata(context, "marble-client")};
  if (const auto authorization = metadata(context, "authorization")) given.token = bearer_of(*authorization);
  if (context.client_metadata().count("authorization") > 1) given.token = "";  // which one applies is unclear
  return given;
}

Access::Access(const Config& config) : rules_(rules_of(config)) {}

void Access::reload(const Config& config) {
  auto rules = rules_of(config);
  const MutexLock lock(mutex_);
  rules_.swap(rules);
}

std::shared_ptr<const Access::Rules> Access::rules_of(const Config& config) {
  auto rules = std::make_shared<Rules>();
  rules->tokens_known = !config.tokens.empty();
  rules->certificates_known = client_certificate_of(config) != ClientCertificate::none;
  rules->tokens = config.known_tokens;
  rules->default_quota = quota_of_settings(config);
  for (const auto& [name, client] : config.clients) {
    if (client.roles) rules->roles[name] = *client.roles;
    Settings own = config;
    // They were checked when they were read.
    for (const auto& [setting, value] : client.settings) static_cast<void>(set_setting(own, setting, value));
    rules->quotas[name] = quota_of_settings(own);
  }
  return rules;
}

std::shared_ptr<const Access::Rules> Access::rules() const {
  const MutexLock lock(mutex_);
  return rules_;
}

Expected<Identity> Access::identify(const grpc::CallbackServerContext& context) const {
  return identify(credentials_of(context));
}

Expected<Identity> Access::identify(const Credentials& given) const {
  auto identity = identity_of(*rules(), given);
  if (!identity && identity.error().code == ErrorCode::unauthenticated) ++unauthenticated_;
  return identity;
}

bool Access::is_known(const grpc::CallbackServerContext& context) const {
  const auto rules = this->rules();
  if (!rules->tokens_known && !rules->certificates_known) return true;
  return identity_of(*rules, credentials_of(context)).has_value();
}

Expected<Identity> Access::identity_of(const Rules& rules, const Credentials& given) {
  if (rules.tokens_known && given.token) {  // a wrong token is refused, even with a valid certificate
    if (const Token* token = find_token(rules.tokens, *given.token))
      return Identity{token->client, token->roles};
    return unexpected(unauthenticated("the token is not known"));
  }
  if (rules.certificates_known && given.certificate) {
    std::string client = std::string(kCertificatePrefix) + *given.certificate;
    const Roles* roles = find(rules.roles, client);
    return Identity{std::move(client), roles == nullptr ? kCertificateRoles : *roles};
  }
  if (rules.tokens_known || rules.certificates_known) {
    return unexpected(unauthenticated(rules.tokens_known ? "needs a token: authorization: Bearer TOKEN"
                                                         : "needs a client certificate"));
  }
  if (!given.name) return Identity{host_of(given.peer), Roles::all()};
  MARBLE_ASSIGN_OR_RETURN(const auto name, own_name(*given.name));
  return Identity{name, Roles::all()};
}

Expected<Identity> Access::require(const grpc::CallbackServerContext& context, Role role) const {
  return require(credentials_of(context), role);
}

Expected<Identity> Access::require(const Credentials& given, Role role) const {
  auto identity = identify(given);
  if (identity && !identity->roles.has(role)) {
    ++permission_denied_;
    return unexpected(
        failure(ErrorCode::permission_denied, identity->client + " lacks the role " + to_string(role)));
  }
  return identity;
}

bool Access::knows_callers() const {
  const auto rules = this->rules();
  return rules->tokens_known || rules->certificates_known;
}

Quota Access::quota_of(const std::string& client) const {
  const auto rules = this->rules();
  const Quota* own = find(rules->quotas, client);
  return own == nullptr ? rules->default_quota : *own;
}

}  // namespace marble::server
