#include "server/http/request_head.h"

#include <algorithm>
#include <utility>

#include "engine/core/numbers.h"

namespace server::http {
namespace {

tl::unexpected<Refusal> refuse(int status, std::string detail, std::string code = "invalid_argument") {
  return tl::make_unexpected(Refusal{status, std::move(code), std::move(detail), ""});
}

bool is_token_char(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
}

bool is_token(std::string_view text) { return !text.empty() && std::all_of(text.begin(), text.end(), is_token_char); }

bool is_target_char(char c) { return c > 0x20 && c < 0x7f; }

/// Takes the next line, without its CRLF. Nothing: a line that ends in another way.
std::optional<std::string_view> take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos || end == 0 || text[end - 1] != '\r') return std::nullopt;
  const std::string_view line = text.substr(0, end - 1);
  if (line.find('\r') != std::string_view::npos) return std::nullopt;
  text.remove_prefix(end + 1);
  return line;
}

/// A target that names a host ("http://a:1/x?y") as that host and the rest. Nothing: it names none.
struct AbsoluteTarget {
  std::string_view host, rest;
};

std::optional<AbsoluteTarget> split_absolute(std::string_view target) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (!same_ignoring_case(target.substr(0, scheme.size()), scheme)) continue;
    const std::string_view host_and_rest = target.substr(scheme.size());
    const std::size_t end = std::min(host_and_rest.find_first_of("/?#"), host_and_rest.size());
    return AbsoluteTarget{host_and_rest.substr(0, end), host_and_rest.substr(end)};
  }
  return std::nullopt;
}

/// Takes a target apart that is a path, or a path at a host: then `host` is set.
tl::expected<void, Refusal> read_target(std::string_view target, RequestHead& head, std::optional<std::string>& host) {
  if (!std::all_of(target.begin(), target.end(), is_target_char))
    return refuse(400, "the request's address must be printable ASCII");
  if (const auto absolute = split_absolute(target)) {
    if (absolute->host.empty() || absolute->host.find('@') != std::string_view::npos)
      return refuse(400, "the request's address needs a host, and may not name a user");
    host = absolute->host;
    target = absolute->rest;
  } else if (!target.starts_with('/')) {
    return refuse(400, "the request's address must be a path, \"/v1/info\", or one at a host, \"http://host/v1/info\"");
  }
  const std::string_view before_fragment = target.substr(0, target.find('#'));
  const std::size_t question = before_fragment.find('?');
  head.path = before_fragment.substr(0, question);
  if (head.path.empty()) head.path = "/";
  head.query = question == std::string_view::npos ? std::string_view() : before_fragment.substr(question + 1);
  return {};
}

tl::expected<void, Refusal> read_request_line(std::string_view line, RequestHead& head,
                                              std::optional<std::string>& host) {
  const std::size_t first = line.find(' ');
  const std::size_t last = line.rfind(' ');
  if (first == std::string_view::npos || first == last) return refuse(400, "that is no HTTP request");
  const std::string_view method = line.substr(0, first), version = line.substr(last + 1);
  const std::string_view target = line.substr(first + 1, last - first - 1);
  if (!is_token(method) || !version.starts_with("HTTP/")) return refuse(400, "that is no HTTP request");
  if (version != "HTTP/1.1" && version != "HTTP/1.0") return refuse(505, "this service speaks HTTP/1.1", "unsupported");
  if (target.size() > max_target_bytes)
    return refuse(414, "an address may have " + std::to_string(max_target_bytes) + " bytes", "too_large");
  head.method = method;
  head.is_http_1_0 = version == "HTTP/1.0";
  return read_target(target, head, host);
}

tl::expected<void, Refusal> read_field(std::string_view line, RequestHead& head) {
  const std::size_t colon = line.find(':');
  // A line that begins with a space would continue the one before it: obsolete, and a way to hide a header.
  if (colon == std::string_view::npos || !is_token(line.substr(0, colon)))
    return refuse(400, "a header line is malformed");
  const std::string_view value = trim(line.substr(colon + 1));
  if (!is_header_text(value)) return refuse(400, "a header holds a control character");
  if (head.headers.size() == max_header_fields)
    return refuse(431, "a request may have " + std::to_string(max_header_fields) + " headers", "too_large");
  head.headers.emplace_back(lower_case(line.substr(0, colon)), value);
  return {};
}

tl::expected<void, Refusal> read_framing(RequestHead& head) {
  const std::size_t lengths = head.count("content-length"), codings = head.count("transfer-encoding");
  if (lengths > 1 || codings > 1 || (lengths > 0 && codings > 0) || (codings > 0 && head.is_http_1_0))
    return refuse(400, "the request's headers disagree on the length of its body");
  if (codings > 0) {
    if (!same_ignoring_case(head.header("transfer-encoding"), "chunked"))
      return refuse(501, "the only transfer coding this service knows is chunked", "unsupported");
    head.chunked = true;
  }
  if (lengths > 0) {
    head.content_length = engine::number_in<std::uint64_t>(head.header("content-length"));
    if (!head.content_length) return refuse(400, "Content-Length must be a number of bytes");
  }
  return {};
}

void read_connection(RequestHead& head) {
  head.keep_alive = !head.is_http_1_0;
  const std::string options = head.header("connection");
  for (const std::string_view option : split_list(options)) {
    if (same_ignoring_case(option, "close")) head.keep_alive = false;
    if (head.is_http_1_0 && same_ignoring_case(option, "keep-alive")) head.keep_alive = true;
  }
}

}  // namespace

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return lower;
}

bool is_header_text(std::string_view text) {
  return std::none_of(text.begin(), text.end(), [](unsigned char c) { return (c < 0x20 && c != '\t') || c == 0x7f; });
}

bool same_ignoring_case(std::string_view a, std::string_view b) {
  return a.size() == b.size() && lower_case(a) == lower_case(b);
}

std::string_view trim(std::string_view text) {
  const auto is_blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

std::vector<std::string_view> split_list(std::string_view text, char separator) {
  std::vector<std::string_view> elements;
  bool quoted = false;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    if (i < text.size() && text[i] == '"') quoted = !quoted;
    if (i < text.size() && (quoted || text[i] != separator)) continue;
    const std::string_view element = trim(text.substr(begin, i - begin));
    if (!element.empty()) elements.push_back(element);
    begin = i + 1;
  }
  return elements;
}

std::string RequestHead::header(std::string_view name) const {
  std::string all;
  bool found = false;
  for (const auto& [key, value] : headers) {
    if (key != name) continue;
    if (found) all += ", ";
    all += value;
    found = true;
  }
  return all;
}

std::size_t RequestHead::count(std::string_view name) const {
  return std::size_t(std::count_if(headers.begin(), headers.end(), [&](const auto& h) { return h.first == name; }));
}

tl::expected<RequestHead, Refusal> parse_head(std::string_view text) {
  RequestHead head;
  const auto request_line = take_line(text);
  if (!request_line) return refuse(400, "that is no HTTP request");
  std::optional<std::string> host;
  if (const auto read = read_request_line(*request_line, head, host); !read) return tl::make_unexpected(read.error());
  for (;;) {
    const auto line = take_line(text);
    if (!line) return refuse(400, "a header line does not end in CR LF");
    if (line->empty()) break;
    if (const auto read = read_field(*line, head); !read) return tl::make_unexpected(read.error());
  }
  if (const auto read = read_framing(head); !read) return tl::make_unexpected(read.error());
  if (head.count("host") > 1 || (head.count("host") == 0 && !head.is_http_1_0))
    return refuse(400, "a request needs exactly one Host header");
  if (host) {
    std::erase_if(head.headers, [](const auto& header) { return header.first == "host"; });
    head.headers.emplace_back("host", std::move(*host));
  }
  read_connection(head);
  head.expects_continue = same_ignoring_case(head.header("expect"), "100-continue") && !head.is_http_1_0;
  return head;
}

}  // namespace server::http
