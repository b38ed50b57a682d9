#include "engine/elastic/solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "tests/engine/elastic/shapes_of_points.h"

namespace engine::elastic {
namespace {

using std::numbers::pi;

/// Each node joined to those within 1.5 steps.
Graph graph_of(std::vector<DVec3> nodes, double step = 1) {
  Graph graph;
  graph.rest = std::move(nodes);
  graph.begin = {0};
  for (std::size_t i = 0; i < graph.size(); ++i) {
    for (std::uint32_t j = 0; j < graph.size(); ++j)
      if (i != j && glm::distance(graph.rest[i], graph.rest[j]) < 1.5 * step)
        graph.to.push_back(j), graph.weight.push_back(1);
    graph.begin.push_back(std::uint32_t(graph.to.size()));
  }
  return graph;
}

/// A bar of square cross-section along x.
Graph bar(int length, double step = 1) {
  std::vector<DVec3> nodes;
  for (int x = 0; x < length; ++x)
    for (int y = 0; y < 2; ++y)
      for (int z = 0; z < 2; ++z) nodes.push_back(step * DVec3(x, y, z));
  return graph_of(std::move(nodes), step);
}

Grip grip_of(const Graph& graph, std::vector<std::uint32_t> nodes) {
  DVec3 middle(0.0);
  for (const std::uint32_t node : nodes) middle += graph.rest[node] / double(nodes.size());
  return {std::move(nodes), middle};
}

/// The ends of a bar.
std::vector<Grip> ends_of(const Graph& graph) {
  const auto n = std::uint32_t(graph.size());
  return {grip_of(graph, {0, 1, 2, 3}), grip_of(graph, {n - 4, n - 3, n - 2, n - 1})};
}

std::vector<std::vector<GripPose>> one_stop(std::vector<GripPose> poses) { return {std::move(poses)}; }

constexpr DQuat upright(1, 0, 0, 0);
const SolverOptions exactly{.smoothness = 0.5, .most_iterations = 20'000, .settled = 1e-14};

TEST(Solver, KeepsAPieceThatTurnsInOnePiece) {
  const Graph graph = bar(6);
  const auto ends = ends_of(graph);
  const DQuat turn = glm::angleAxis(0.7, glm::normalize(DVec3(1, 2, 3)));
  const DVec3 shift(3, -1, 2);
  std::vector<GripPose> poses;
  for (const Grip& end : ends) poses.push_back({turn * end.source + shift, turn});
  const Pose pose = Solver(graph, ends, exactly).solve(one_stop(poses));
  for (std::size_t i = 0; i < graph.size(); ++i)
    EXPECT_LT(glm::distance(pose.position[i], turn * graph.rest[i] + shift), 1e-6) << i;
  EXPECT_LT(energy(graph, pose, 0.5), 1e-10);
}

TEST(Solver, FindsTheTurnOfAGripThatIsFreeToTurn) {
  const Graph graph = bar(6);
  auto ends = ends_of(graph);
  ends[1].nodes.resize(2), ends[1].source = graph.rest[ends[1].nodes[0]];
  const DQuat turn = glm::angleAxis(0.7, DVec3(0, 0, 1));
  const Pose pose = Solver(graph, ends, exactly)
                        .solve(one_stop({{turn * ends[0].source, turn}, {turn * ends[1].source, std::nullopt}}));
  EXPECT_NEAR(std::abs(glm::dot(pose.turn.back(), turn)), 1, 1e-9);
}

TEST(Solver, LosesEnergyInEachStep) {
  const Graph graph = bar(12);
  const auto ends = ends_of(graph);
  const DQuat turn = glm::angleAxis(1.2, DVec3(0, 1, 0));
  std::vector<double> energies;
  const Pose pose = Solver(graph, ends, exactly)
                        .solve(one_stop({{ends[0].source, upright}, {ends[1].source + DVec3(-3, 1, 4), turn}}),
                               [&](double value, std::size_t) { energies.push_back(value); });
  ASSERT_GT(energies.size(), 5u);
  for (std::size_t k = 1; k < energies.size(); ++k) EXPECT_LE(energies[k], energies[k - 1] * (1 + 1e-12)) << k;
  EXPECT_NEAR(energies.back(), energy(graph, pose, 0.5), 1e-12 * energies.back());
}

TEST(Solver, LosesEnergyInEachStepWithGripsThatAreFreeToTurnAndScale) {
  const Graph graph = bar(12);
  const auto ends = ends_of(graph);
  std::vector<double> energies;
  (void)Solver(graph, ends, exactly)
      .solve(one_stop({{ends[0].source, upright}, {ends[1].source + DVec3(-2, 5, 0), std::nullopt, 1.7}}),
             [&](double value, std::size_t) { energies.push_back(value); });
  ASSERT_GT(energies.size(), 5u);
  for (std::size_t k = 1; k < energies.size(); ++k) EXPECT_LE(energies[k], energies[k - 1] * (1 + 1e-12)) << k;
}

/// Energies by moving one number at a time, a little either way, by less and less: knows no gradient.
double searched_energy(const Graph& graph, Pose pose, const std::vector<std::uint32_t>& nodes, double smoothness) {
  double best = energy(graph, pose, smoothness);
  for (double step = 0.1; step > 1e-9;) {
    bool found = false;
    for (const std::uint32_t node : nodes)
      for (int number = 0; number < 6; ++number)
        for (const double by : {step, -step}) {
          Pose tried = pose;
          DVec3 along(0.0);
          along[number % 3] = by;
          if (number < 3)
            tried.position[node] += along;
          else
            tried.turn[node] = glm::normalize(DQuat(1, along.x, along.y, along.z) * tried.turn[node]);
          if (const double value = energy(graph, tried, smoothness); value < best)
            best = value, pose = std::move(tried), found = true;
        }
    if (!found) step *= 0.5;
  }
  return best;
}

TEST(Solver, FindsWhatASearchWithoutGradientsFinds) {
  const Graph graph = bar(3);
  const auto ends = ends_of(graph);
  const std::vector<GripPose> poses{{ends[0].source, upright},
                                    {ends[1].source + DVec3(0.1, 0.5, 0), glm::angleAxis(0.6, DVec3(0, 0, 1))}};
  const Pose pose = Solver(graph, ends, exactly).solve(one_stop(poses));
  Pose start = pose;  // grips where they go, the rest as it was
  const std::vector<std::uint32_t> free_nodes{4, 5, 6, 7};
  for (const std::uint32_t node : free_nodes) start.position[node] = graph.rest[node], start.turn[node] = upright;
  const double found = energy(graph, pose, 0.5), searched = searched_energy(graph, start, free_nodes, 0.5);
  EXPECT_NEAR(found, searched, 1e-6 * searched);
}

TEST(Solver, TwistsABarByMoreThanHalfATurn) {
  const Graph graph = bar(20);
  const auto ends = ends_of(graph);
  std::vector<std::vector<GripPose>> way;
  const double angle = 1.5 * pi;
  for (int stop = 1; stop <= 9; ++stop)
    way.push_back({{ends[0].source, upright}, {ends[1].source, glm::angleAxis(angle * stop / 9, DVec3(1, 0, 0))}});
  const Pose pose = Solver(graph, ends, exactly).solve(way);
  // The middle has turned by half of it, the long way.
  const DVec3 middle = pose.turn[40] * DVec3(0, 1, 0);
  const double turned = std::atan2(middle.z, middle.y), expected = std::remainder(angle * 10 / 19, 2 * pi);
  EXPECT_NEAR(std::remainder(turned - expected, 2 * pi), 0, 0.15);
}

TEST(Solver, TakesNodesInARow) {
  std::vector<DVec3> nodes;
  for (int x = 0; x < 8; ++x) nodes.emplace_back(x, 0, 0);
  const Graph graph = graph_of(nodes);
  const std::vector<Grip> ends{grip_of(graph, {0}), grip_of(graph, {7})};
  const Pose pose =
      Solver(graph, ends, exactly).solve(one_stop({{DVec3(0.0), upright}, {DVec3(0, 7, 0), std::nullopt}}));
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    EXPECT_TRUE(std::isfinite(pose.position[i].x)) << i;
    EXPECT_NEAR(glm::length(pose.turn[i]), 1, 1e-9) << i;
  }
  EXPECT_LT(glm::distance(pose.position[7], DVec3(0, 7, 0)), 1e-12);
}

TEST(Solver, OfOneNodeGoesWithIt) {
  Graph graph;
  graph.rest = {DVec3(1, 2, 3)};
  graph.begin = {0, 0};
  const Pose pose = Solver(graph, {{{0}, graph.rest[0]}}).solve(one_stop({{DVec3(4, 5, 6), std::nullopt}}));
  EXPECT_EQ(pose.position[0], DVec3(4, 5, 6));
  EXPECT_EQ(pose.turn[0], upright);
  EXPECT_EQ(linear_maps(graph, pose)[0], DMat3(1.0));
}

TEST(Solver, TakesGripsAtThePlaceOfOthers) {
  Graph graph = bar(5);
  const auto ends = ends_of(graph);
  const Pose pose = Solver(graph, ends).solve(one_stop({{ends[0].source, upright}, {ends[0].source, upright}}));
  for (const DVec3& position : pose.position) EXPECT_TRUE(std::isfinite(glm::length(position)));
}

TEST(Solver, HoldsAtAnySizeAndScale) {
  for (const double size : {1e-9, 1e-3, 1e3, 1e6})
    for (const double scale : {1e-3, 1.0, 1e3}) {
      SCOPED_TRACE(size);
      SCOPED_TRACE(scale);
      const Graph graph = bar(6, size);
      const auto ends = ends_of(graph);
      const Pose pose = Solver(graph, ends)
                            .solve(one_stop({{scale * ends[0].source, upright, scale},
                                             {scale * ends[1].source, glm::angleAxis(0.3, DVec3(1, 0, 0)), scale}}));
      for (const DVec3& position : pose.position) EXPECT_TRUE(std::isfinite(glm::length(position)));
      for (const DMat3& map : linear_maps(graph, pose))
        for (int column = 0; column < 3; ++column) EXPECT_TRUE(std::isfinite(glm::length(map[column])));
    }
}

TEST(LinearMaps, ShowHowABodyIsStretched) {
  const Graph graph = bar(6);
  Pose pose{graph.rest, std::vector<DQuat>(graph.size(), upright), std::vector<double>(graph.size(), 1.0)};
  for (DVec3& position : pose.position) position.x *= 1.5;
  for (const DMat3& map : linear_maps(graph, pose)) {
    EXPECT_NEAR(map[0].x, 1.5, 0.05);
    EXPECT_NEAR(map[1].y, 1, 0.05);
  }
}

TEST(LinearMaps, AcrossASheetOnlyTurn) {
  std::vector<DVec3> nodes;
  for (int x = 0; x < 5; ++x)
    for (int y = 0; y < 5; ++y) nodes.emplace_back(x, y, 0);
  const Graph graph = graph_of(nodes);
  const DQuat turn = glm::angleAxis(0.8, DVec3(1, 0, 0));
  Pose pose{graph.rest, std::vector<DQuat>(graph.size(), turn), std::vector<double>(graph.size(), 1.0)};
  for (DVec3& position : pose.position) position = turn * DVec3(1.3 * position.x, position.y, 0);
  for (const DMat3& map : linear_maps(graph, pose)) {
    EXPECT_NEAR(glm::distance(map[2], turn * DVec3(0, 0, 1)), 0, 1e-9);
    EXPECT_NEAR(glm::length(map[0]), 1.3, 0.05);
  }
}

}  // namespace
}  // namespace engine::elastic
