// The tokens that let somebody in, and what each of them may do.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "engine/core/names.h"

namespace server::http {

/// What a token may do. None takes another in, but that whoever edits also sees.
enum class Scope {
  read,  ///< Sees: scenes, pictures, files, edits; what is asked and changes nothing, such as previews.
  edit,  ///< Changes: uploads, edits, names, removals.
  admin  ///< What only an operator should: metrics, taking up what has failed.
};
constexpr auto names_of(Scope) {
  using engine::Name;
  return std::array{Name{Scope::read, "read"}, Name{Scope::edit, "edit"}, Name{Scope::admin, "admin"}};
}

constexpr std::size_t max_secret_bytes = 4096;  // a choice

/// How much may be asked for with a token. What is not said has no limit.
struct Quotas {
  std::optional<std::size_t> edits = {};      ///< That wait or run at a time.
  std::optional<std::uint64_t> bytes = {};    ///< Of uploads that are stored.
  std::optional<std::uint64_t> seconds = {};  ///< Of work on edits, from midnight to midnight UTC.
};

/// A secret with the name of whoever has it.
struct Token {
  std::string name;  ///< For people, logs and records: letters, digits, '.', '-', '_'.
  bool read = false, edit = false, admin = false;
  std::string secret;  ///< Printable ASCII without spaces, 1 to max_secret_bytes. Stands in no message, in no log.
  Quotas quotas = {};

  [[nodiscard]] bool may(Scope scope) const {
    switch (scope) {
      case Scope::read:
        return read || edit;
      case Scope::edit:
        return edit;
      case Scope::admin:
        return admin;
    }
    return false;
  }
  /// Whether a session that was opened with the other one may go on with this one, whatever its quotas are now.
  [[nodiscard]] bool may_the_same_as(const Token& other) const {
    return name == other.name && secret == other.secret && read == other.read && edit == other.edit &&
           admin == other.admin;
  }
};

/// Who makes a request; null where the service has no tokens.
using TokenPtr = std::shared_ptr<const Token>;

/// The token of a service that has one word for all: it may do everything. No token of a line has its name.
constexpr std::string_view only_token_name = "default";
[[nodiscard]] inline Token only_token(std::string secret) {
  return {.name = std::string(only_token_name), .read = true, .edit = true, .admin = true, .secret = std::move(secret)};
}

}  // namespace server::http
