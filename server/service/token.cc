#include "server/service/token.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace server::service {

using engine::ErrorCode;
using engine::Result;

Result<std::string> read_token(const std::filesystem::path& file, std::string& warning) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0)
    return engine::fail(errno == ENOENT ? ErrorCode::not_found : ErrorCode::unavailable,
                        std::string("the token file cannot be read: ") + std::strerror(errno), file.string());
  std::ifstream in(file, std::ios::binary);
  constexpr std::size_t max_bytes = 4096;  // of the file: more is no token
  std::string text(max_bytes + 1, '\0');
  in.read(text.data(), std::streamsize(text.size()));
  text.resize(std::size_t(in.gcount()));
  if (in.bad() || (text.empty() && !in.eof()))
    return engine::fail(ErrorCode::unavailable, "the token file cannot be read", file.string());
  const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; };
  while (!text.empty() && is_blank(text.back())) text.pop_back();
  text.erase(text.begin(), std::find_if_not(text.begin(), text.end(), is_blank));
  if (text.empty()) return engine::fail(ErrorCode::invalid_argument, "the token file is empty", file.string());
  if (text.size() > max_bytes || std::any_of(text.begin(), text.end(), [](char c) { return c <= 0x20 || c >= 0x7f; }))
    return engine::fail(ErrorCode::invalid_argument,
                        "a token is one word of printable ASCII, up to 4096 bytes; make one with: openssl rand -hex 32",
                        file.string());
  if ((status.st_mode & S_IROTH) != 0)
    warning = "other users of this machine can read the token file: chmod 600 " + file.string();
  return text;
}

bool is_loopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host == "[::1]" || host.starts_with("127.");
}

}  // namespace server::service
