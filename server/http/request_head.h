// The head of an HTTP/1.1 request: request line and header fields, taken apart strictly. Whatever two parsers could
// read in two ways is refused, so that nothing can hide between them (RFC 9112, sections 3, 5, 6 and 11.2).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <utility>
#include <vector>

namespace server::http {

/// Why a request is not handled, in HTTP's own terms.
struct Refusal {
  int status = 400;
  std::string code = "invalid_argument";
  std::string detail;
  std::string where;
  /// Seconds; said with 429 and 503. What is in the way of most requests passes within one. 0: nobody can say when.
  int retry_after = 1;
  std::string scope = {};  ///< Of 403: what the token lacks; empty: it is not for that.
};

/// What the head says.
struct RequestHead {
  std::string method;
  std::string path;   ///< Path as sent, still escaped; without scheme and host where the target names them, too.
  std::string query;  ///< What follows the '?', as sent.
  bool is_http_1_0 = false;
  std::vector<std::pair<std::string, std::string>> headers;  ///< Names in lower case, values trimmed.
  std::optional<std::uint64_t> content_length;
  bool chunked = false;
  bool keep_alive = true;         ///< The client would send another request on this connection.
  bool expects_continue = false;  ///< The client waits for "100 Continue" before it sends the body.

  /// Whether it is a GET or a HEAD: only these know "not modified".
  [[nodiscard]] bool only_reads() const { return method == "GET" || method == "HEAD"; }
  [[nodiscard]] bool has_body() const { return chunked || content_length.value_or(0) > 0; }
  /// The value of a header, in lower case; of several, joined by ", ". Empty if there is none.
  [[nodiscard]] std::string header(std::string_view name) const;
  [[nodiscard]] std::size_t count(std::string_view name) const;
};

constexpr std::size_t max_header_fields = 100;  ///< Of one request; browsers send about 20. A choice.
constexpr std::size_t max_target_bytes = 8192;  ///< Of path and query; RFC 9112 recommends 8000 at least.

/// Takes a head apart.
///   text     up to and including the empty line
///   returns  the head, or a refusal: 400 malformed, 431 too many fields, 414 a target too long, 501 a transfer coding
///            other than chunked, 505 not HTTP/1.x. Where the target names a host ("GET http://a:1/x"), that is the
///            one in `headers`, whatever Host says (RFC 9112, section 3.2.2).
[[nodiscard]] tl::expected<RequestHead, Refusal> parse_head(std::string_view text);

/// Whether this may stand in a header's value: no control characters but the tabulator.
[[nodiscard]] bool is_header_text(std::string_view text);
/// Whether two header values or names are the same but for case; ASCII.
[[nodiscard]] bool same_ignoring_case(std::string_view a, std::string_view b);
[[nodiscard]] std::string lower_case(std::string_view text);
[[nodiscard]] std::string_view trim(std::string_view text);
/// The elements of a list "a, b": trimmed, without empty ones. Commas within quotes do not count.
[[nodiscard]] std::vector<std::string_view> split_list(std::string_view text, char separator = ',');

}  // namespace server::http
