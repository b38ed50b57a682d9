#include "server/service/routes/all_routes.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "server/service/embedded_files.h"
#include "tests/support/data.h"

namespace server::service::routes {
namespace {

/// "GET /v1/scenes" for every operation of the contract, with what its security asks of a token. Paths stand two spaces
/// from the margin, methods four.
std::map<std::string, std::string> operations_of(std::string_view contract) {
  std::map<std::string, std::string> found;
  std::string path, operation;
  bool within_paths = false;
  std::istringstream lines{std::string(contract)};
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.front() != ' ' && line.front() != '#') within_paths = line == "paths:";
    if (!within_paths) continue;
    if (line.starts_with("  /")) path = line.substr(2, line.find(':') - 2);
    for (const char* method : {"GET", "POST", "PUT", "PATCH", "DELETE"}) {
      std::string lower(method);
      for (char& letter : lower) letter = char(std::tolower(letter));
      if (!line.starts_with("    " + lower + ":")) continue;
      operation = method + (" " + path);
      found[operation] = "[{bearer: [read]}, {cookie: [read]}, {}]";  // of all that say nothing else
    }
    if (line.starts_with("      security: ")) found[operation] = line.substr(line.find('['));
  }
  return found;
}

std::string security_of(const http::Route& route) {
  const auto with = [](const std::string& scope) {
    return "[{bearer: [" + scope + "]}, {cookie: [" + scope + "]}, {}]";
  };
  switch (route.access) {
    case http::Access::open:
      return route.method == "DELETE" ? "[{cookie: []}, {}]" : "[]";
    case http::Access::token:
      return "[{bearer: []}, {}]";
    case http::Access::read:
      return with("read");
    case http::Access::edit:
      return with("edit");
    case http::Access::admin:
      return with("admin");
  }
  return "";
}

TEST(AllRoutes, AreThoseOfTheContract) {
  const support::TempDir folder;
  scenes::StoreOptions store_options;
  store_options.folder = folder.path() / "scenes";
  auto scenes = scenes::SceneStore::open(store_options);
  ASSERT_TRUE(scenes) << scenes.error().message;
  edits::Selections selections(**scenes);
  edits::ServiceOptions edit_options;
  edit_options.folder = folder.path() / "edits";
  auto edits = edits::EditService::open(**scenes, edit_options);
  ASSERT_TRUE(edits) << edits.error().message;
  RenderService renders({});
  SceneViews views(**scenes);
  http::AccessGuard guard({});
  http::Metrics metrics;
  const http::Router router = all_routes({**scenes, **edits, selections, {}, renders, views, guard, metrics, {}});

  std::set<std::string> page;
  for (const EmbeddedFile& file : page_files()) page.insert("GET /" + std::string(file.name));
  std::map<std::string, std::string> routes;
  for (const http::Route& route : router.routes())
    if (const std::string name = route.method + " " + route.path; !page.contains(name))
      routes[name] = security_of(route);

  const auto operations = operations_of(contract_files().front().bytes);
  EXPECT_GT(operations.size(), 20u) << "the contract is not read rightly";
  EXPECT_EQ(routes, operations);
}

TEST(WorkerRoutes, TellOfItsHealthAndWhereElseToAsk) {
  const http::Metrics metrics;
  const http::Router router = worker_routes(metrics, [] { return std::nullopt; });
  std::vector<std::string> paths;
  for (const http::Route& route : router.routes()) paths.push_back(route.path);
  EXPECT_EQ(paths, (std::vector<std::string>{"/healthz", "/readyz", "/metrics"}));
  EXPECT_NE(router.of_others().find("ask a front"), std::string::npos);
}

}  // namespace
}  // namespace server::service::routes
