// Cases by their names. `Known` is whatever is known of a case before it is made; it has a `name`.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace engine::evaluate {

/// The names of all cases, in order.
template <class Known>
[[nodiscard]] std::vector<std::string> names_of_cases(const std::vector<Known>& all) {
  std::vector<std::string> names;
  for (const Known& known : all) names.push_back(known.name);
  return names;
}

/// The case of that name, one of `all`.
///   kind    what the cases are: "captured case"
///   errors  not_found: none has that name; the message lists those there are
template <class Known>
[[nodiscard]] Result<const Known*> find_case(const std::vector<Known>& all, const std::string& name,
                                             const std::string& kind) {
  if (const auto found = std::ranges::find(all, name, &Known::name); found != all.end()) return &*found;
  std::string names;
  for (const Known& known : all) names += (names.empty() ? "" : ", ") + known.name;
  return fail(ErrorCode::not_found, "there is no " + kind + " \"" + name + "\"; there are " + names, "case");
}

/// The names given, each that of a case; all, if none are.
///   errors  those of find_case()
template <class Known>
[[nodiscard]] Result<std::vector<std::string>> choose_names(const std::vector<Known>& all,
                                                            const std::vector<std::string>& names,
                                                            const std::string& kind) {
  for (const std::string& name : names)
    if (const auto found = find_case(all, name, kind); !found) return propagate(found);
  return names.empty() ? names_of_cases(all) : names;
}

}  // namespace engine::evaluate
