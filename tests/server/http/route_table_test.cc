#include "server/http/route_table.h"

#include <gtest/gtest.h>

namespace server::http {
namespace {

Router routes() {
  Router router;
  for (const auto& [method, path] : std::vector<std::pair<const char*, const char*>>{{"GET", "/"},
                                                                                     {"GET", "/v1/edits/{id}"},
                                                                                     {"DELETE", "/v1/edits/{id}"},
                                                                                     {"GET", "/v1/edits/latest"},
                                                                                     {"GET", "/v1/{what}/{id}/file"}})
    router.add({method, path, nullptr, Body::none, {}, Access::open});
  return router;
}

TEST(RouteTable, PrefersWhatIsSpeltOut) {
  const RouteTable table(routes());
  EXPECT_EQ(table.find("GET", {"v1", "edits", "latest"}).route->path, "/v1/edits/latest");
  const RouteMatch match = table.find("GET", {"v1", "edits", "e1"});
  EXPECT_EQ(match.route->path, "/v1/edits/{id}");
  EXPECT_EQ(match.values.at("id"), "e1");
  EXPECT_EQ(table.find("GET", {""}).route->path, "/");
  EXPECT_EQ(table.find("HEAD", {"v1", "x", "y", "file"}).values.at("what"), "x");
}

TEST(RouteTable, ListsTheMethodsOfAPath) {
  const RouteTable table(routes());
  const RouteMatch match = table.find("PUT", {"v1", "edits", "e1"});
  EXPECT_EQ(match.route, nullptr);
  EXPECT_EQ(match.allow, "DELETE, GET, HEAD");
  EXPECT_EQ(table.find("GET", {"v1", "edits"}).allow, "");
  EXPECT_EQ(table.find("GET", {"v1", "edits", ""}).route, nullptr) << "nothing is no id";
}

TEST(RouteTable, CallsWhatAPathNamesByWhatStandsBeforeIt) {
  const RouteTable table(routes());
  const std::vector<NamedThing> edit{{"edit", "e1"}};
  EXPECT_EQ(things_named(table.find("DELETE", {"v1", "edits", "e1"})), edit);
  EXPECT_TRUE(things_named(table.find("GET", {"v1", "edits", "latest"})).empty());
  EXPECT_TRUE(things_named(table.find("GET", {"nowhere"})).empty());
  EXPECT_EQ(thing_at_end("/v1/edits/e000001"), (NamedThing{"edit", "e000001"}));
  EXPECT_EQ(thing_at_end("/"), std::nullopt);
}

}  // namespace
}  // namespace server::http
