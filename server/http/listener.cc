#include "server/http/listener.h"

#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <memory>

namespace server::http {
namespace {

using engine::ErrorCode;
using engine::Result;

constexpr int backlog = 128;  // connections that wait in the system's own line; a choice

Result<int> bind_to(const addrinfo& address, const std::string& host, int port) {
  const int socket =
      ::socket(address.ai_family, address.ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, address.ai_protocol);
  const std::string name = host + ":" + std::to_string(port);
  if (socket < 0)
    return engine::fail(ErrorCode::unavailable, "cannot open a socket for " + name + ": " + std::strerror(errno),
                        "--host");
  // Not SO_REUSEPORT: with it, two services would quietly share the port.
  const int yes = 1;
  ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  if (::bind(socket, address.ai_addr, address.ai_addrlen) == 0 && ::listen(socket, backlog) == 0) return socket;
  const int error = errno;
  ::close(socket);
  if (error == EADDRINUSE)
    return engine::fail(ErrorCode::unavailable,
                        "port " + std::to_string(port) + " is taken by another program; choose another, or 0 for any",
                        "--port");
  if (error == EACCES)
    return engine::fail(ErrorCode::unavailable, "port " + std::to_string(port) + " is not permitted to this user",
                        "--port");
  return engine::fail(ErrorCode::unavailable, "cannot listen on " + name + ": " + std::strerror(error), "--host");
}

}  // namespace

Result<int> listen_on(const std::string& host, int port) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const std::string bare = host.starts_with('[') && host.ends_with(']') ? host.substr(1, host.size() - 2) : host;
  if (const int error = ::getaddrinfo(bare.c_str(), std::to_string(port).c_str(), &hints, &found); error != 0)
    return engine::fail(ErrorCode::invalid_argument, "there is no host \"" + host + "\": " + ::gai_strerror(error),
                        "--host");
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> addresses(found, ::freeaddrinfo);
  Result<int> bound = engine::fail(ErrorCode::invalid_argument, "the host \"" + host + "\" has no address", "--host");
  for (const addrinfo* address = found; address != nullptr && !bound; address = address->ai_next)
    bound = bind_to(*address, host, port);
  return bound;
}

int bound_port(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  if (::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return 0;
  return ntohs(address.ss_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6&>(address).sin6_port
                                             : reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

}  // namespace server::http
