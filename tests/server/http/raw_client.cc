#include "tests/server/http/raw_client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <utility>

namespace server::http {
namespace {

std::string lower(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return text;
}

}  // namespace

std::string RawAnswer::header(const std::string& name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? "" : found->second;
}

RawClient::RawClient(int port, const std::string& from) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  if (::inet_pton(AF_INET, from.c_str(), &address.sin_addr) != 1 ||
      ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    std::abort();
  address.sin_port = htons(std::uint16_t(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) std::abort();
}

RawClient::~RawClient() { ::close(socket_); }

bool RawClient::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(std::size_t(sent));
  }
  return true;
}

bool RawClient::receive(std::chrono::milliseconds time) {
  pollfd watched{socket_, POLLIN, 0};
  if (::poll(&watched, 1, int(time.count())) <= 0) return false;
  std::array<char, 65536> piece;
  const ssize_t got = ::recv(socket_, piece.data(), piece.size(), 0);
  if (got <= 0) return false;
  input_.append(piece.data(), std::size_t(got));
  return true;
}

std::optional<RawAnswer> RawClient::answer(bool has_body) {
  const auto line = [&]() -> std::optional<std::string> {
    std::size_t end;
    while ((end = input_.find("\r\n")) == std::string::npos)
      if (!receive()) return std::nullopt;
    std::string text = input_.substr(0, end);
    input_.erase(0, end + 2);
    return text;
  };
  const auto bytes = [&](std::size_t count) -> std::optional<std::string> {
    while (input_.size() < count)
      if (!receive()) return std::nullopt;
    std::string text = input_.substr(0, count);
    input_.erase(0, count);
    return text;
  };
  RawAnswer answer;
  const auto status_line = line();
  if (!status_line || status_line->size() < 12) return std::nullopt;
  answer.status = std::atoi(status_line->c_str() + 9);
  answer.phrase = status_line->size() > 13 ? status_line->substr(13) : "";
  for (;;) {
    const auto header = line();
    if (!header) return std::nullopt;
    if (header->empty()) break;
    const std::size_t colon = header->find(": ");
    answer.headers.emplace(lower(header->substr(0, colon)), header->substr(colon + 2));
  }
  if (!has_body || answer.status < 200 || answer.status == 204 || answer.status == 304) return answer;
  if (answer.headers.contains("content-length")) {
    const auto body = bytes(std::size_t(std::atoll(answer.header("content-length").c_str())));
    if (!body) return std::nullopt;
    answer.body = *body;
    return answer;
  }
  if (answer.header("transfer-encoding") == "chunked") {
    for (;;) {
      const auto size = line();
      if (!size) return std::nullopt;
      const auto piece = bytes(std::strtoul(size->c_str(), nullptr, 16) + 2);
      if (!piece) return std::nullopt;
      if (piece->size() == 2) return answer;
      answer.body += piece->substr(0, piece->size() - 2);
    }
  }
  while (receive()) continue;
  answer.body = std::exchange(input_, {});
  return answer;
}

std::string RawClient::read_until(std::string_view text) {
  while (input_.find(text) == std::string::npos)
    if (!receive()) break;
  return std::exchange(input_, {});
}

bool RawClient::is_closed_within(std::chrono::milliseconds time) {
  pollfd watched{socket_, POLLIN, 0};
  char byte = 0;
  return ::poll(&watched, 1, int(time.count())) > 0 && ::recv(socket_, &byte, 1, 0) <= 0;
}

void RawClient::finish_sending() { ::shutdown(socket_, SHUT_WR); }

std::string request(int port, const std::string& method, const std::string& target, const std::string& more,
                    const std::string& body) {
  std::string text = method + " " + target + " HTTP/1.1\r\n";
  if (!lower(more).starts_with("host:")) text += "Host: 127.0.0.1:" + std::to_string(port) + "\r\n";
  if (!body.empty()) text += "Content-Length: " + std::to_string(body.size()) + "\r\n";
  return text + more + "\r\n" + body;
}

RawAnswer ask(int port, const std::string& method, const std::string& target, const std::string& more,
              const std::string& body) {
  RawClient client(port);
  client.send(request(port, method, target, more, body));
  return client.answer(method != "HEAD").value_or(RawAnswer{});
}

}  // namespace server::http
