// Who may speak to the service: which Host, from which Origin, with which token or session.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/http/guess_brake.h"
#include "server/http/request_head.h"

namespace server::http {

/// Who is let in.
struct AccessOptions {
  std::string token;  ///< Secret that clients must send; empty: none is needed.
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
  explicit AccessGuard(AccessOptions options)
      : options_(std::move(options)), token_(options_.token), brake_(options_.guesses) {}

  /// Tells the guard which names the service goes by; called once, before the first request.
  void bound_to(const std::string& host, int port);

  /// Whether a request is meant for this service and comes from no foreign page. A browser sends a page's requests with
  /// the page's Origin; a rebound DNS name shows in Host.
  ///   returns  a refusal: 421 misdirected_request, 403 forbidden
  [[nodiscard]] std::optional<Refusal> check_origin(const RequestHead& head) const;

  [[nodiscard]] bool needs_token() const { return !options_.token.empty(); }
  /// Whether a request carries the token. Takes the same time wherever the two differ. Wrong ones are counted by the
  /// client's address; after a few, none is looked at for a while.
  ///   authorization  header
  ///   client         address_of() the request
  ///   returns        a refusal: 401 unauthorized, 429 busy
  [[nodiscard]] std::optional<Refusal> check_token(std::string_view authorization, const std::string& client) const;
  /// Whether a request carries the token or a session's cookie, or needs neither. As check_token().
  [[nodiscard]] std::optional<Refusal> check_access(const RequestHead& head, const std::string& client) const;
  /// Replaces the token by another one, neither empty; sessions that were opened with the old one end.
  void replace_token(std::string token);

  [[nodiscard]] bool trusts_proxy() const { return options_.trust_proxy; }
  /// The address of the client: that of its connection, or what a trusted proxy says it is.
  ///   peer           address of the connection
  ///   forwarded_for  header X-Forwarded-For
  [[nodiscard]] std::string address_of(const std::string& peer, std::string_view forwarded_for) const;
  /// Whether the client speaks TLS with a trusted proxy.
  ///   forwarded_proto  header X-Forwarded-Proto
  [[nodiscard]] bool is_secure(std::string_view forwarded_proto) const;

  /// A new session.
  ///   returns  its secret, for the cookie
  [[nodiscard]] std::string open_session();
  /// Ends the session that a Cookie header names, if it does.
  void close_session(std::string_view cookies);

  static constexpr std::string_view cookie_name = "splatdrag_session";

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] bool is_own_host(std::string_view host) const;
  [[nodiscard]] bool has_session(std::string_view cookies) const;
  [[nodiscard]] bool is_token(std::string_view given) const;

  const AccessOptions options_;
  std::vector<std::string> own_hosts_;
  mutable std::mutex mutex_;  ///< Guards token_ and sessions_.
  std::string token_;
  std::map<std::string, Clock::time_point> sessions_;  ///< Time of opening by secret.
  mutable GuessBrake brake_;
};

/// 32 random hexadecimal digits, from the system's own source.
[[nodiscard]] std::string random_id();

}  // namespace server::http
