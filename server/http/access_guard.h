// Who may speak to the service: which Host, from which Origin, with which token or session, and what they may do.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "server/http/guess_brake.h"
#include "server/http/request_head.h"
#include "server/http/token.h"

namespace server::http {

/// Who is let in.
struct AccessOptions {
  std::vector<Token> tokens;  ///< Of which clients must send one, all different; empty: none is needed.
  std::vector<std::string>
      allowed_hosts;  ///< Names beside the bound host and the loopback ones: "name" or "name:port".
  std::vector<std::string> allowed_origins;              ///< Origins beside the service's own: "https://example.org".
  std::size_t max_sessions = 1000;                       ///< Sessions open at a time; a new one ends the oldest.
  std::chrono::seconds session_lifetime{7 * 24 * 3600};  ///< From opening on; a week is a choice.
  /// Believes what a proxy in front says of its client, X-Forwarded-For and X-Forwarded-Proto: their last entries. For
  /// a service that nobody reaches but through the proxy, else anybody may write them.
  bool trust_proxy = false;
  GuessBrakeOptions guesses = {};
};

/// Safe to call from any thread.
class AccessGuard {
 public:
  explicit AccessGuard(AccessOptions options);

  /// Tells the guard which names the service goes by; called once, before the first request.
  void bound_to(const std::string& host, int port);

  /// Whether a request is meant for this service and comes from no foreign page. A browser sends a page's requests with
  /// the page's Origin; a rebound DNS name shows in Host.
  ///   returns  a refusal: 421 misdirected_request, 403 forbidden
  [[nodiscard]] std::optional<Refusal> check_origin(const RequestHead& head) const;

  [[nodiscard]] bool needs_token() const { return !options_.tokens.empty(); }
  /// The token that a request carries; null where none is needed. What it carries is held against all tokens, and takes
  /// the same time wherever they differ. Wrong ones are counted by the client's address; after a few, none is looked at
  /// for a while.
  ///   authorization  header
  ///   client         address_of() the request
  ///   returns        or a refusal: 401 unauthorized, 429 busy
  [[nodiscard]] tl::expected<TokenPtr, Refusal> check_token(std::string_view authorization,
                                                            const std::string& client) const;
  /// The token that a request carries, or, where it carries none, that of the session whose cookie it carries. As
  /// check_token().
  [[nodiscard]] tl::expected<TokenPtr, Refusal> check_access(const RequestHead& head, const std::string& client) const;
  /// Whether whoever has this token, of which none is needed if it is null, may do that.
  ///   returns  a refusal: 403 forbidden, which names the token and what it lacks
  [[nodiscard]] static std::optional<Refusal> check_scope(const Token* token, Scope scope);
  /// Whether this token, of which none is needed if it is null, still is one: as it was, but for what a session may
  /// outlive.
  [[nodiscard]] bool still_knows(const Token* token) const;
  /// Whether there is one word for all (only_token()).
  [[nodiscard]] bool has_only_token() const;
  /// Replaces all tokens by others, neither none. Sessions end that were opened with a token that is gone, or has
  /// another name, secret or scope.
  void replace_tokens(std::vector<Token> tokens);

  [[nodiscard]] bool trusts_proxy() const { return options_.trust_proxy; }
  /// The address of the client: that of its connection, or what a trusted proxy says it is.
  ///   peer           address of the connection
  ///   forwarded_for  header X-Forwarded-For
  [[nodiscard]] std::string address_of(const std::string& peer, std::string_view forwarded_for) const;
  /// Whether the client speaks TLS with a trusted proxy.
  ///   forwarded_proto  header X-Forwarded-Proto
  [[nodiscard]] bool is_secure(std::string_view forwarded_proto) const;

  /// A new session, which may do what its token may.
  ///   returns  its secret, for the cookie; nothing: the token is none any more, since the request was let in with it
  [[nodiscard]] std::optional<std::string> open_session(const Token& token);
  /// The token of the session that a Cookie header names; null: it names none.
  [[nodiscard]] TokenPtr token_of_session(std::string_view cookies) const;
  /// Ends the session that a Cookie header names, if it does.
  void close_session(std::string_view cookies);

  static constexpr std::string_view cookie_name = "splatdrag_session";

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] bool is_own_host(std::string_view host) const;
  [[nodiscard]] TokenPtr token_of_secret(std::string_view secret) const;

  const AccessOptions options_;
  std::vector<std::string> own_hosts_;
  struct Session {
    Clock::time_point opened;
    TokenPtr token;
  };
  [[nodiscard]] std::shared_ptr<const std::vector<TokenPtr>> tokens() const;

  mutable std::mutex mutex_;  ///< Guards tokens_, which are compared without it, and sessions_.
  std::shared_ptr<const std::vector<TokenPtr>> tokens_;
  std::map<std::string, Session> sessions_;  ///< By secret.
  mutable GuessBrake brake_;
};

/// 32 random hexadecimal digits, from the system's own source.
[[nodiscard]] std::string random_id();

}  // namespace server::http
