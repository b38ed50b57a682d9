// A client that speaks to a server in bytes, so that tests can send what no HTTP library would.
#pragma once

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <string_view>

namespace server::http {

struct RawAnswer {
  int status = 0;
  std::string phrase;
  std::multimap<std::string, std::string> headers;  ///< Names in lower case.
  std::string body;                                 ///< Without chunked framing.

  /// Empty if there is none.
  [[nodiscard]] std::string header(const std::string& name) const;
};

class RawClient {
 public:
  ///   from  the client's own address, one of the loopback network
  explicit RawClient(int port, const std::string& from = "127.0.0.1");
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  /// false once the server has closed the connection.
  bool send(std::string_view bytes);
  /// The next answer; nothing if the server closes, or says nothing for five seconds, before it is complete.
  ///   has_body  false for an answer to HEAD
  std::optional<RawAnswer> answer(bool has_body = true);
  /// Whatever arrives until the text has been seen, or the connection ends.
  std::string read_until(std::string_view text);
  /// Whether the server closes the connection within `time`, without another byte.
  bool is_closed_within(std::chrono::milliseconds time);
  /// No more will be sent.
  void finish_sending();

 private:
  bool receive(std::chrono::milliseconds time = std::chrono::seconds(5));

  int socket_;
  std::string input_;
};

/// A request in bytes: "GET /x HTTP/1.1", Host, and `more` header lines (each with its CR LF), then the body.
std::string request(int port, const std::string& method, const std::string& target, const std::string& more = {},
                    const std::string& body = {});

/// Sends one request on a connection of its own.
RawAnswer ask(int port, const std::string& method, const std::string& target, const std::string& more = {},
              const std::string& body = {});

}  // namespace server::http
