// Enumerations whose values have names outside of the program: on the wire, on the command line, on the page.
//
// The names stand beside the enumeration, in its namespace, in the order in which they are listed to people:
//   enum class Mode { move, extend };
//   constexpr std::array names_of(Mode) { return std::array{Name{Mode::move, "move"}, Name{Mode::extend, "extend"}}; }
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <concepts>
#include <optional>
#include <string_view>

namespace engine {

/// The name of one value.
template <class E>
struct Name {
  E value;
  std::string_view text;
};

template <class E>
Name(E, const char*) -> Name<E>;  // a compiler before aggregates' deduction (P1816) needs to be told

/// An enumeration whose values have names.
template <class E>
concept Named = requires {
  { names_of(E{})[0] } -> std::convertible_to<Name<E>>;
};

/// The names of all values.
template <Named E>
constexpr auto names = names_of(E{});

/// The name of a value, such as "shortest_arc". Precondition: it is one of the enumerators.
template <Named E>
[[nodiscard]] constexpr std::string_view name_of(E value) {
  const auto found = std::ranges::find(names<E>, value, &Name<E>::value);
  assert(found != names<E>.end());
  return found->text;
}

/// The value of that name; nothing for another text.
template <Named E>
[[nodiscard]] constexpr std::optional<E> value_named(std::string_view text) {
  const auto found = std::ranges::find(names<E>, text, &Name<E>::text);
  if (found == names<E>.end()) return std::nullopt;
  return found->value;
}

}  // namespace engine
