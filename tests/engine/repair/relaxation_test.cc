#include "engine/repair/relaxation.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace engine::repair {
namespace {

/// A function on a grid, what is known of it, and where it is relaxed.
struct Problem {
  GridSize size{};
  std::vector<Knowledge> known;
  std::vector<std::uint8_t> is_free;
  std::vector<float> values;
};

/// Noise of every kind, free but for a block and single nodes. Zeros of either sign are among the values.
Problem noise(const GridSize& size, std::uint64_t seed) {
  Rng rng(seed, 0);
  Problem out{size, {}, {}, {}};
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        const auto known = Knowledge(rng.below(4));
        const float value = (float(rng.below(2001)) - 1000) / 1000 * float(rng.below(5) != 0);
        const bool is_bounded_below = known == Knowledge::not_negative, is_above = known == Knowledge::not_positive;
        out.known.push_back(known);
        out.values.push_back(is_bounded_below ? std::max(value, 0.0f) : is_above ? std::min(value, 0.0f) : value);
        out.is_free.push_back(std::max({x, y, z}) > 5 && rng.below(50) != 0);
      }
  return out;
}

/// What relax() does, as it is written down: node after node of each colour, the differences one after the other.
class Reference {
 public:
  Reference(const Problem& problem, float pull) : problem_(problem), pull_(pull), values_(problem.values) {}

  const std::vector<float>& relaxed(int sweeps) {
    const GridSize& size = problem_.size;
    for (int step = 0; step < 7 * sweeps; ++step)
      for (int z = 0; z < size[2]; ++z)
        for (int y = 0; y < size[1]; ++y)
          for (int x = 0; x < size[0]; ++x)
            if ((x + 2 * y + 3 * z) % 7 == step % 7 && is_free({x, y, z})) relax({x, y, z});
    return values_;
  }

 private:
  using Node = std::array<int, 3>;

  [[nodiscard]] std::size_t index(const Node& at) const { return node_index(problem_.size, at[0], at[1], at[2]); }
  [[nodiscard]] bool is_free(const Node& at) const {
    for (std::size_t a = 0; a < 3; ++a)
      if (at[a] < 0 || at[a] >= problem_.size[a]) return false;
    return problem_.is_free[index(at)] != 0;
  }
  [[nodiscard]] float value(const Node& at) const { return values_[index(at)]; }
  static Node moved(Node at, std::size_t a, int u, std::size_t b = 0, int v = 0) {
    at[a] += u, at[b] += v;
    return at;
  }

  void relax(const Node& at) {
    float slope = 0, curvature = 0;
    add_differences(at, slope, curvature);
    if (curvature == 42) slope = biharmonic(at);  // every difference counts
    const std::size_t node = index(at);
    const Knowledge known = problem_.known[node];
    if (known == Knowledge::value) slope += pull_ * (values_[node] - problem_.values[node]), curvature += pull_;
    if (!(curvature > 0)) return;
    float next = values_[node] - 1.6f * slope / curvature;
    if (known == Knowledge::not_negative) next = std::max(next, 0.0f);
    if (known == Knowledge::not_positive) next = std::min(next, 0.0f);
    values_[node] = next;
  }

  void add_differences(const Node& at, float& slope, float& curvature) const {
    for (std::size_t a = 0; a < 3; ++a)
      for (int middle = -1; middle <= 1; ++middle) {
        const Node before = moved(at, a, middle - 1), there = moved(at, a, middle), after = moved(at, a, middle + 1);
        if (!is_free(before) || !is_free(there) || !is_free(after)) continue;
        const float share = middle == 0 ? -2.0f : 1.0f;
        slope += share * (value(before) - 2 * value(there) + value(after)), curvature += share * share;
      }
    for (std::size_t a = 0; a < 3; ++a)
      for (const int u : {-1, 1})
        for (const int v : {-1, 1}) {
          const std::size_t b = (a + 1) % 3;
          const Node first = moved(at, a, u), second = moved(at, b, v), both = moved(at, a, u, b, v);
          if (!is_free(first) || !is_free(second) || !is_free(both)) continue;
          slope += 2 * (value(at) - value(first) - value(second) + value(both)), curvature += 2;
        }
  }

  [[nodiscard]] float biharmonic(const Node& at) const {
    float beside = 0, diagonal = 0, beyond = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto by = [&](int u, int v) { return value(moved(at, a, u, (a + 1) % 3, v)); };
      beside += by(1, 0) + by(-1, 0);
      diagonal += by(1, 1) + by(1, -1) + by(-1, 1) + by(-1, -1);
      beyond += by(2, 0) + by(-2, 0);
    }
    return 42 * value(at) - 12 * beside + 2 * diagonal + beyond;
  }

  const Problem& problem_;
  float pull_;
  std::vector<float> values_;
};

std::vector<float> relaxed(const Problem& problem, float pull, int sweeps) {
  std::vector<float> values = problem.values;
  relax(problem.size, problem.known, problem.is_free, pull, sweeps, values);
  return values;
}

/// Zeros have signs.
std::vector<std::uint32_t> bits_of(const std::vector<float>& values) {
  std::vector<std::uint32_t> out;
  for (const float value : values) out.push_back(std::bit_cast<std::uint32_t>(value));
  return out;
}

TEST(Relax, TheSameBitsAsNodeByNodeWithEveryInstructionSet) {
  const GridSize sizes[]{{23, 17, 11}, {7, 14, 21}, {40, 9, 10}, {8, 40, 9}, {61, 7, 1}, {1, 30, 30}};
  for (const std::int64_t instruction_set : hwy::SupportedAndGeneratedTargets()) {
    hwy::GetChosenTarget().Update(instruction_set);
    for (const GridSize& size : sizes) {
      SCOPED_TRACE(std::string(hwy::TargetName(instruction_set)) + " " + std::to_string(size[0]) + " x " +
                   std::to_string(size[1]) + " x " + std::to_string(size[2]));
      const Problem problem = noise(size, std::uint64_t(size[0]));
      EXPECT_EQ(bits_of(relaxed(problem, 0.3f, 5)), bits_of(Reference(problem, 0.3f).relaxed(5)));
    }
    for (const GridSize& size :
         {GridSize{1, 1, 1}, GridSize{2, 3, 1}, GridSize{3, 3, 3}}) {  // smaller than the stencil
      SCOPED_TRACE(std::string(hwy::TargetName(instruction_set)) + ", small " + std::to_string(size[0]));
      Problem problem = noise(size, 5);
      std::ranges::fill(problem.is_free, std::uint8_t{1});
      EXPECT_EQ(bits_of(relaxed(problem, 0.3f, 5)), bits_of(Reference(problem, 0.3f).relaxed(5)));
    }
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(Relax, TheSameForAnyNumberOfThreads) {
  const Problem problem = noise({75, 66, 50}, 3);  // more than one task a colour, rows that are no multiple of seven
  const auto on = [&](int threads) {
    std::vector<float> values;
    WorkArena(threads).run([&] { values = relaxed(problem, 1, 4); });
    return values;
  };
  const std::vector<float> alone = on(1);
  EXPECT_NE(alone, problem.values);
  EXPECT_EQ(alone, on(2));
  EXPECT_EQ(alone, on(4));
}

TEST(Relax, WhatIsNotFreeStays) {
  const Problem problem = noise({30, 20, 20}, 4);
  const std::vector<float> after = relaxed(problem, 1, 3);
  for (std::size_t node = 0; node < after.size(); ++node)
    if (problem.is_free[node] == 0) {
      ASSERT_EQ(after[node], problem.values[node]) << node;
    }
}

}  // namespace
}  // namespace engine::repair
