#include "engine/edit/annealing.h"

#include <gtest/gtest.h>

#include <vector>

namespace engine::edit {
namespace {

std::vector<double> strengths(Annealing annealing, int steps) {
  Params params;
  params.annealing = annealing;
  params.annealing_steps = steps;
  params.strength_initial = 0.8, params.strength_final = 0.2;
  std::vector<double> out;
  for (int a = 1; a <= steps; ++a) out.push_back(strength_of(params, a));
  return out;
}

TEST(Annealing, StrengthFallsFromTheFirstCorrectionToTheLast) {
  const auto linear = strengths(Annealing::linear, 3), paper = strengths(Annealing::paper, 3);
  for (std::size_t a = 0; a < 3; ++a) {
    EXPECT_NEAR(linear[a], 0.8 - 0.3 * double(a), 1e-12) << a;
    EXPECT_NEAR(paper[a], 0.8 - 0.2 * double(a), 1e-12) << a;
  }
}

TEST(Annealing, OneCorrectionIsTheFirst) {
  for (const Annealing annealing : {Annealing::linear, Annealing::paper})
    EXPECT_EQ(strengths(annealing, 1), std::vector<double>{0.8});
}

TEST(Annealing, TheLastOneIsAsWeakAsAskedForAndThePrintedOneStronger) {
  for (const int steps : {2, 5, 100}) {
    EXPECT_NEAR(strengths(Annealing::linear, steps).back(), 0.2, 1e-12) << steps;
    EXPECT_GT(strengths(Annealing::paper, steps).back(), 0.2 + 0.5 / steps) << steps;
  }
}

}  // namespace
}  // namespace engine::edit
