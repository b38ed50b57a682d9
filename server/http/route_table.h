// Finds the route of a request.
#pragma once

#include <map>
#include <string>
#include <string_view>
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
