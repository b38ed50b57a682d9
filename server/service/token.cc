#include "server/service/token.h"

#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "engine/core/numbers.h"

namespace server::service {

using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::Result;
using http::Token;

namespace {

// Choices, all of them:
constexpr std::size_t max_file_bytes = 64 * 1024;
constexpr std::size_t max_name_bytes = 64;
constexpr std::size_t max_tokens = 256;  // each request is held against all of them

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

bool is_secret(std::string_view word) {
  return !word.empty() && word.size() <= http::max_secret_bytes &&
         std::ranges::all_of(word, [](char c) { return c > 0x20 && c < 0x7f; });
}

bool is_name(std::string_view word) {
  return word.size() <= max_name_bytes && std::ranges::all_of(word, [](char c) {
           return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-' ||
                  c == '_';
         });
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  while (true) {
    const auto begin = std::ranges::find_if_not(text, is_blank);
    const auto end = std::find_if(begin, text.end(), is_blank);
    if (begin == text.end()) return words;
    words.emplace_back(begin, end);
    text = {end, text.end()};
  }
}

/// Whether all of them are scopes; then the token has them.
bool give_scopes(std::string_view list, Token& token) {
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(',', begin), list.size());
    const auto scope = engine::value_named<http::Scope>(list.substr(begin, end - begin));
    if (!scope) return false;
    switch (*scope) {
      case http::Scope::read:
        token.read = true;
        break;
      case http::Scope::edit:
        token.edit = true;
        break;
      case http::Scope::admin:
        token.admin = true;
        break;
    }
    begin = end + 1;
  }
  return true;
}

/// 2'000'000'000 for "2GB". Nothing for what is no such number, or larger than any disk.
std::optional<std::uint64_t> bytes_in(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, std::uint64_t>, 9> units{{{"KiB", std::uint64_t{1} << 10},
                                                                             {"MiB", std::uint64_t{1} << 20},
                                                                             {"GiB", std::uint64_t{1} << 30},
                                                                             {"TiB", std::uint64_t{1} << 40},
                                                                             {"kB", 1'000},
                                                                             {"MB", 1'000'000},
                                                                             {"GB", 1'000'000'000},
                                                                             {"TB", 1'000'000'000'000},
                                                                             {"", 1}}};
  const auto unit = std::ranges::find_if(units, [&](const auto& known) { return text.ends_with(known.first); });
  const auto number = engine::number_in<std::uint64_t>(text.substr(0, text.size() - unit->first.size()));
  if (!number || *number > std::numeric_limits<std::uint64_t>::max() / unit->second) return std::nullopt;
  return *number * unit->second;
}

/// Whether the word is a quota that the token does not have yet; then it has it.
bool give_quota(std::string_view word, http::Quotas& quotas) {
  const std::size_t equals = std::min(word.find('='), word.size());
  const std::string_view name = word.substr(0, equals), text = word.substr(std::min(equals + 1, word.size()));
  const auto give = [](auto& quota, const auto& number) {
    if (quota || !number || *number == 0) return false;
    quota = number;
    return true;
  };
  if (name == "edits") return give(quotas.edits, engine::number_in<std::size_t>(text));
  if (name == "bytes") return give(quotas.bytes, bytes_in(text));
  // More than a century is a slip.
  if (name == "seconds") return give(quotas.seconds, engine::number_in<std::uint32_t>(text));
  return false;
}

/// The tokens of the file's lines.
class TokenLines {
 public:
  explicit TokenLines(const std::filesystem::path& file) : file_(file) {}

  Result<void> take(std::string_view line) {
    ++number_;
    auto words = words_of(line);
    words.erase(std::ranges::find_if(words, [](std::string_view word) { return word.starts_with('#'); }), words.end());
    if (words.empty()) return {};
    if (words.size() < 3) return wrong("expected three words: a name, its scopes, and the secret");
    Token token;
    token.name = words[0];
    if (!is_name(token.name))
      return wrong("a name has up to 64 letters, digits and characters of \".-_\" (the first word)");
    if (!give_scopes(words[1], token))
      return wrong("scopes are read, edit and admin, with commas between several (the second word)");
    token.secret = words[2];
    if (!is_secret(token.secret))
      return wrong("a secret is up to 4096 bytes of printable ASCII; make one with: openssl rand -hex 32");
    if (token.name == http::only_token_name)
      return wrong("the name is that of the token of a file of one word: choose another");
    for (const std::string_view word : std::span(words).subspan(3))
      if (!give_quota(word, token.quotas))
        return wrong("quotas are such as edits=4, bytes=2GB and seconds=3600, each once (what follows the secret)");
    if (const auto [known, added] = names_.emplace(token.name, number_); !added)
      return wrong("it has the name of line " + std::to_string(known->second));
    if (const auto [known, added] = secrets_.emplace(token.secret, number_); !added)
      return wrong("it has the secret of line " + std::to_string(known->second));
    if (tokens.size() == max_tokens) return wrong("there may be " + std::to_string(max_tokens) + " tokens");
    tokens.push_back(std::move(token));
    return {};
  }

  std::vector<Token> tokens;

 private:
  [[nodiscard]] tl::unexpected<engine::Error> wrong(std::string what) const {
    return fail(ErrorCode::invalid_argument, std::move(what), file_.string() + ":" + std::to_string(number_));
  }

  const std::filesystem::path& file_;
  int number_ = 0;
  std::map<std::string, int> names_, secrets_;  ///< The lines they stand in.
};

Result<std::string> read_text(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string text(max_file_bytes + 1, '\0');
  in.read(text.data(), std::streamsize(text.size()));
  text.resize(std::size_t(in.gcount()));
  if (in.bad() || (text.empty() && !in.eof()))
    return fail(ErrorCode::unavailable, "the token file cannot be read", file.string());
  if (text.size() > max_file_bytes)
    return fail(ErrorCode::invalid_argument, "a token file has up to 64 KiB", file.string());
  return text;
}

}  // namespace

Result<std::vector<Token>> read_tokens(const std::filesystem::path& file, std::string& warning) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0)
    return fail(errno == ENOENT ? ErrorCode::not_found : ErrorCode::unavailable,
                std::string("the token file cannot be read: ") + std::strerror(errno), file.string());
  const auto text = read_text(file);
  if (!text) return propagate(text);
  const auto words = words_of(*text);
  if (words.empty()) return fail(ErrorCode::invalid_argument, "the token file is empty", file.string());
  TokenLines lines(file);
  if (words.size() == 1 && words.front() != "#") {
    if (!is_secret(words.front()))
      return fail(ErrorCode::invalid_argument,
                  "a token is one word of printable ASCII, up to 4096 bytes; make one with: openssl rand -hex 32",
                  file.string());
    lines.tokens.push_back(http::only_token(std::string(words.front())));
  } else {
    for (std::size_t begin = 0; begin < text->size();) {
      const std::size_t end = std::min(text->find('\n', begin), text->size());
      if (auto taken = lines.take(std::string_view(*text).substr(begin, end - begin)); !taken) return propagate(taken);
      begin = end + 1;
    }
    if (lines.tokens.empty())
      return fail(ErrorCode::invalid_argument, "the token file has comments and no token", file.string());
  }
  if ((status.st_mode & S_IROTH) != 0)
    warning = "other users of this machine can read the token file: chmod 600 " + file.string();
  return std::move(lines.tokens);
}

bool is_loopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host == "[::1]" || host.starts_with("127.");
}

}  // namespace server::service
