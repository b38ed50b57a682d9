#include "engine/edit/plan.h"

#include <algorithm>
#include <array>

namespace engine::edit {
namespace {

constexpr std::array<std::string_view, stage_count> names{"assign",   "views",    "deform",  "mask",       "correct",
                                                          "optimise", "relocate", "renders", "checkpoint", "finish"};

void add_interval(std::vector<PlannedStage>& plan, int u, const Workload& work) {
  const auto add = [&](Stage stage, double seconds) { plan.push_back({stage, u, seconds}); };
  if (work.shown) add(Stage::renders, 0.3);
  add(Stage::deform, 0.05);
  add(Stage::mask, 0.5);
  add(Stage::deform, 0.1);
  if (work.shown) add(Stage::renders, 0.3);
  add(Stage::mask, 0.5);
  for (int a = 1; work.iterations > 0 && a <= work.corrections; ++a) {
    if (work.corrected) add(Stage::correct, 3);
    if (work.corrected && work.shown && a == work.corrections) add(Stage::renders, 0.1);
    add(Stage::optimise, 0.01 * work.iterations);
  }
  if (work.iterations > 0 && work.shown) add(Stage::renders, 0.3);
  add(Stage::relocate, 0.01);
  if (work.kept) add(Stage::checkpoint, 0.05);
}

}  // namespace

std::string_view name_of(Stage stage) { return names[std::size_t(stage)]; }

std::optional<Stage> stage_named(std::string_view name) {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return Stage(found - names.begin());
}

std::vector<PlannedStage> plan_of(const Workload& work) {
  std::vector<PlannedStage> plan{{Stage::assign, 0, 0.05}, {Stage::views, 0, 0.5}};
  for (int u = 1; u <= work.intervals; ++u) add_interval(plan, u, work);
  plan.push_back({Stage::finish, 0, 0.05});
  return plan;
}

}  // namespace engine::edit
