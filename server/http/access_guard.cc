#include "server/http/access_guard.h"

#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>

namespace server::http {
namespace {

constexpr std::string_view bearer = "bearer ";

/// Compares all of what is given, so that the time taken tells nothing about where they differ.
///   expected  not empty
bool same_secret(std::string_view given, std::string_view expected) {
  unsigned difference = given.size() == expected.size() ? 0 : 1;
  for (std::size_t i = 0; i < given.size(); ++i)
    difference |= unsigned(static_cast<unsigned char>(given[i]) ^
                           static_cast<unsigned char>(expected[std::min(i, expected.size() - 1)]));
  return difference == 0;
}

/// Is what stands in an Authorization header a token, not what a proxy in front asked a person for?
bool is_bearer(std::string_view authorization) {
  return authorization.size() >= bearer.size() && same_ignoring_case(authorization.substr(0, bearer.size()), bearer);
}

std::string cookie_in(std::string_view cookies) {
  for (const std::string_view cookie : split_list(cookies, ';'))
    if (cookie.size() > AccessGuard::cookie_name.size() && cookie.starts_with(AccessGuard::cookie_name) &&
        cookie[AccessGuard::cookie_name.size()] == '=')
      return std::string(cookie.substr(AccessGuard::cookie_name.size() + 1));
  return {};
}

bool is_safe(std::string_view method) { return method == "GET" || method == "HEAD" || method == "OPTIONS"; }

}  // namespace

std::string random_id() {
  std::array<unsigned char, 16> bytes{};
  while (::getrandom(bytes.data(), bytes.size(), 0) != ssize_t(bytes.size()))
    if (errno != EINTR) throw std::runtime_error("the system gives no random numbers");
  std::string text;
  for (const unsigned char byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

AccessGuard::AccessGuard(AccessOptions options) : options_(std::move(options)), brake_(options_.guesses) {
  replace_tokens(options_.tokens);
}

void AccessGuard::bound_to(const std::string& host, int port) {
  const std::string bracketed = host.find(':') == std::string::npos ? host : "[" + host + "]";
  for (const std::string& name :
       {bracketed, std::string("localhost"), std::string("127.0.0.1"), std::string("[::1]")}) {
    own_hosts_.push_back(lower_case(name) + ":" + std::to_string(port));
    if (port == 80) own_hosts_.push_back(lower_case(name));
  }
}

bool AccessGuard::is_own_host(std::string_view host) const {
  const std::string given = lower_case(host);
  if (std::find(own_hosts_.begin(), own_hosts_.end(), given) != own_hosts_.end()) return true;
  const std::size_t colon = given.rfind(':');
  const bool has_port = colon != std::string::npos && given.find(']', colon) == std::string::npos;
  const std::string name = has_port ? given.substr(0, colon) : given;
  return std::any_of(options_.allowed_hosts.begin(), options_.allowed_hosts.end(), [&](const std::string& allowed) {
    return same_ignoring_case(allowed, given) || same_ignoring_case(allowed, name);
  });
}

std::optional<Refusal> AccessGuard::check_origin(const RequestHead& head) const {
  const std::string host = head.header("host");
  // HTTP/1.0 knows no Host, and health checks of proxies speak it. Browsers, which the check is there for (a foreign
  // page that drives the service under a name of its own), have always sent one.
  const bool names_none = head.is_http_1_0 && head.count("host") == 0;
  if (!names_none && !is_own_host(host))
    return Refusal{421, "misdirected_request",
                   "this service does not go by the name in the Host header; --allowed-host adds names", ""};
  const Refusal foreign{403, "forbidden",
                        "a page of another site may not use this service; if the service goes by that name, behind a "
                        "proxy, --allowed-origin says so",
                        ""};
  if (head.count("origin") > 0) {
    const std::string origin = head.header("origin");
    const bool own =
        !names_none && (same_ignoring_case(origin, "http://" + host) || same_ignoring_case(origin, "https://" + host));
    const bool allowed = std::any_of(options_.allowed_origins.begin(), options_.allowed_origins.end(),
                                     [&](const std::string& other) { return same_ignoring_case(origin, other); });
    if (!own && !allowed) return foreign;
    return std::nullopt;
  }
  // Without an Origin: a navigation, a picture, a program. Following a link to the page is fine; making the service
  // work for another site's picture, or changing anything, is not.
  const std::string site = head.header("sec-fetch-site");
  const bool from_elsewhere = site == "cross-site" || site == "same-site";
  const bool follows_link = is_safe(head.method) && head.header("sec-fetch-mode") == "navigate";
  if (from_elsewhere && !follows_link) return foreign;
  return std::nullopt;
}

TokenPtr AccessGuard::token_of_secret(std::string_view secret) const {
  if (secret.size() > max_secret_bytes) return nullptr;  // nobody is to make work by what is none
  TokenPtr found;
  for (const TokenPtr& token : *tokens())  // all of them: which one it is does not show in the time either
    if (same_secret(secret, token->secret)) found = token;
  return found;
}

std::shared_ptr<const std::vector<TokenPtr>> AccessGuard::tokens() const {
  const std::lock_guard lock(mutex_);
  return tokens_;
}

tl::expected<TokenPtr, Refusal> AccessGuard::check_token(std::string_view authorization,
                                                         const std::string& client) const {
  if (!needs_token()) return nullptr;
  const Refusal wanted{401, "unauthorized", "this service wants a token: \"Authorization: Bearer ...\"", ""};
  if (!is_bearer(authorization)) return tl::make_unexpected(wanted);
  if (const auto seconds = brake_.must_wait(client))
    return tl::make_unexpected(Refusal{
        429, "busy", "too many wrong tokens came from your address: try again in " + std::to_string(*seconds) + " s",
        "", *seconds});
  const std::string given(trim(authorization.substr(bearer.size())));
  if (TokenPtr token = token_of_secret(given)) {
    // Whoever has one of several may be after the others.
    if (has_only_token()) brake_.forget(client);
    return token;
  }
  brake_.count_wrong(client, given);
  return tl::make_unexpected(wanted);
}

std::optional<Refusal> AccessGuard::check_scope(const Token* token, Scope scope) {
  if (token == nullptr || token->may(scope)) return std::nullopt;
  const std::string name(engine::name_of(scope));
  Refusal refusal{403, "forbidden",
                  "token \"" + token->name + "\" may not " +
                      (scope == Scope::admin ? "do what is for operators" : name) + ": it lacks the scope " + name,
                  ""};
  refusal.scope = name;
  return refusal;
}

bool AccessGuard::still_knows(const Token* token) const {
  if (token == nullptr) return true;
  return std::ranges::any_of(*tokens(), [&](const TokenPtr& known) { return known->may_the_same_as(*token); });
}

bool AccessGuard::has_only_token() const {
  const auto known = tokens();
  return known->size() == 1 && known->front()->name == only_token_name;
}

void AccessGuard::replace_tokens(std::vector<Token> tokens) {
  auto known = std::make_shared<std::vector<TokenPtr>>();
  for (Token& token : tokens) known->push_back(std::make_shared<const Token>(std::move(token)));
  const std::lock_guard lock(mutex_);
  tokens_ = known;
  for (auto session = sessions_.begin(); session != sessions_.end();) {
    const auto same = std::ranges::find_if(
        *known, [&](const TokenPtr& token) { return token->may_the_same_as(*session->second.token); });
    if (same == known->end()) {
      session = sessions_.erase(session);
    } else {
      session->second.token = *same;
      ++session;
    }
  }
}

std::string AccessGuard::address_of(const std::string& peer, std::string_view forwarded_for) const {
  if (!options_.trust_proxy) return peer;
  const auto names =
      split_list(forwarded_for, ',');  // the last is the proxy's own word, those before came with the request
  return names.empty() || names.back().empty() ? peer : std::string(names.back());
}

bool AccessGuard::is_secure(std::string_view forwarded_proto) const {
  const auto names = split_list(forwarded_proto, ',');
  return options_.trust_proxy && !names.empty() && same_ignoring_case(names.back(), "https");
}

TokenPtr AccessGuard::token_of_session(std::string_view cookies) const {
  const std::string secret = cookie_in(cookies);
  if (secret.empty()) return nullptr;
  const std::lock_guard lock(mutex_);
  TokenPtr found;
  for (const auto& [known, session] : sessions_)
    if (same_secret(secret, known) && Clock::now() - session.opened < options_.session_lifetime) found = session.token;
  return found;
}

tl::expected<TokenPtr, Refusal> AccessGuard::check_access(const RequestHead& head, const std::string& client) const {
  if (!needs_token()) return nullptr;
  const std::string authorization = head.header("authorization");
  if (is_bearer(authorization)) return check_token(authorization, client);
  if (TokenPtr token = token_of_session(head.header("cookie"))) return token;
  return check_token(authorization, client);
}

std::optional<std::string> AccessGuard::open_session(const Token& token) {
  const std::string secret = random_id();
  const std::lock_guard lock(mutex_);
  const auto known = std::ranges::find_if(*tokens_, [&](const TokenPtr& one) { return one->may_the_same_as(token); });
  if (known == tokens_->end()) return std::nullopt;
  std::erase_if(sessions_, [&](const auto& s) { return Clock::now() - s.second.opened >= options_.session_lifetime; });
  while (!sessions_.empty() && sessions_.size() >= options_.max_sessions)
    sessions_.erase(std::ranges::min_element(sessions_, {}, [](const auto& s) { return s.second.opened; }));
  sessions_[secret] = {Clock::now(), *known};
  return secret;
}

void AccessGuard::close_session(std::string_view cookies) {
  const std::lock_guard lock(mutex_);
  sessions_.erase(cookie_in(cookies));
}

}  // namespace server::http
