#include "server/http/network.h"

#include <arpa/inet.h>

#include <algorithm>
#include <array>

namespace server::http {

std::string network_of(const std::string& address) {
  std::array<char, 16> bytes{};
  if (::inet_pton(AF_INET6, address.c_str(), bytes.data()) != 1) return address;
  constexpr std::array<char, 12> mapped{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, char(0xff), char(0xff)};
  if (std::equal(mapped.begin(), mapped.end(), bytes.begin())) {
    std::array<char, INET_ADDRSTRLEN> text{};
    return ::inet_ntop(AF_INET, bytes.data() + mapped.size(), text.data(), text.size());
  }
  return "v6:" + std::string(bytes.data(), bytes.size() / 2);
}

}  // namespace server::http
