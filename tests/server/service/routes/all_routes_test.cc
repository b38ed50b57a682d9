#include "server/service/routes/all_routes.h"

#include <gtest/gtest.h>

#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "server/service/embedded_files.h"
#include "tests/support/data.h"

namespace server::service::routes {
namespace {

/// "GET /v1/scenes" for every operation of the contract. Paths stand two spaces from the margin, methods four.
std::set<std::string> operations_of(std::string_view contract) {
  std::set<std::string> found;
  std::string path;
  bool within_paths = false;
  std::istringstream lines{std::string(contract)};
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty() && line.front() != ' ' && line.front() != '#') within_paths = line == "paths:";
    if (!within_paths) continue;
    if (line.starts_with("  /")) path = line.substr(2, line.find(':') - 2);
    for (const char* method : {"GET", "POST", "PUT", "PATCH", "DELETE"}) {
      std::string lower(method);
      for (char& letter : lower) letter = char(std::tolower(letter));
      if (line.starts_with("    " + lower + ":")) found.insert(method + (" " + path));
    }
  }
  return found;
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
  std::set<std::string> routes;
  for (const http::Route& route : router.routes())
    if (const std::string name = route.method + " " + route.path; !page.contains(name)) routes.insert(name);

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
