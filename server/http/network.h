// What one client may have addresses of.
#pragma once

#include <string>

namespace server::http {

/// The network of an address, as a key: an IPv4 address (be it written as IPv6), or the 64 bits that name a network of
/// IPv6. What is no address is itself.
[[nodiscard]] std::string network_of(const std::string& address);

}  // namespace server::http
