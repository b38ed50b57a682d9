// Finds the route of a request.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/http/router.h"

namespace server::http {

using PathValues = std::map<std::string, std::string, std::less<>>;

/// What a method and a path lead to.
struct RouteMatch {
  const Route* route = nullptr;  ///< Null: there is none.
  PathValues values;             ///< What stands for the {names} of the route's path.
  std::string allow;             ///< Methods that the path has, if it has any: for 405.
};

/// A thing that a path names, and what it is called there: "scene" and "s000001".
using NamedThing = std::pair<std::string, std::string>;
/// What a path names, called by what stands before it: {"scene", "s000001"} and {"version", "3"} of
/// "/v1/scenes/s000001/versions/3". Nothing where there is no route.
[[nodiscard]] std::vector<NamedThing> things_named(const RouteMatch& match);
/// What a path ends with: {"edit", "e000001"} of "/v1/edits/e000001".
[[nodiscard]] std::optional<NamedThing> thing_at_end(std::string_view path);

/// Immutable once it is made: safe to call from any thread.
class RouteTable {
 public:
  explicit RouteTable(Router router);

  /// The route of a method and a path in its segments. HEAD finds the GET route. A segment that a path spells out comes
  /// before one that it leaves open.
  [[nodiscard]] RouteMatch find(std::string_view method, const std::vector<std::string>& segments) const;
  [[nodiscard]] const std::vector<Route>& routes() const { return router_.routes(); }
  [[nodiscard]] const std::string& of_others() const { return router_.of_others(); }

 private:
  Router router_;
  std::vector<std::vector<std::string>> segments_;  ///< Segments of each route's path, in the order of routes().
};

}  // namespace server::http
