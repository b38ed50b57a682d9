#include "engine/select/footing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "engine/core/rng.h"
#include "tests/engine/select/small_scenes.h"

namespace engine::select {
namespace {

constexpr double spacing = 0.1;
constexpr int side = 6;  // rows of a block along its edges

/// A block of 0.5 on what is around it, y up; its lowest rows touch that.
class Standing {
 public:
  explicit Standing(DVec3 foot, double unit = 1, int layers = side) : unit_(unit) {
    for (int x = 0; x < side; ++x)
      for (int y = 0; y < layers; ++y)
        for (int z = 0; z < side; ++z) {
          const DVec3 place(x - 0.5 * (side - 1), y + 0.5, z - 0.5 * (side - 1));
          part_.push_back(std::uint32_t(cloud_.size()));
          touches_.push_back(y == 0 ? Touch::stands : Touch::nothing);
          add(foot + spacing * place);
        }
  }
  void add(DVec3 at, float opacity_logit = 4) {
    add_at(cloud_, Vec3(unit_ * at), opacity_logit, float(std::log(0.5 * spacing * unit_)));
  }
  void add_to_part(DVec3 at, float opacity_logit) {
    part_.push_back(std::uint32_t(cloud_.size()));
    touches_.push_back(Touch::nothing);
    add(at, opacity_logit);
  }
  /// A floor over x from `from` to `to`, as high as `height` says.
  void add_floor(double from, double to, const std::function<double(DVec2)>& height) {
    for (double x = from; x < to; x += spacing)
      for (double z = -1.5; z < 1.55; z += spacing) add({x, height({x, z}), z});
  }
  void lies_below(double depth, int rows) {  // what a trainer leaves where nobody looks
    Rng rng(7);
    for (int k = 0; k < rows; ++k)
      add({double(rng.uniform(-0.5f, 0.5f)), -depth * double(rng.uniform()), double(rng.uniform(-0.5f, 0.5f))});
  }
  void touches_nothing() { touches_.assign(touches_.size(), Touch::nothing); }

  [[nodiscard]] std::optional<Footings> after(const std::function<DVec3(DVec3)>& motion) const {
    const scene::LayeredCloud scene{std::make_shared<const scene::GaussianCloud>(cloud_), nullptr};
    return Stance(scene, cloud_.mean, part_, touches_, part_).after(scene, cloud_.mean, [&](DVec3 at) {
      return unit_ * motion(at / unit_);
    });
  }
  [[nodiscard]] std::optional<Footings> after(DVec3 shift) const {
    return after([&](DVec3 place) { return place + shift; });
  }

 private:
  double unit_;
  scene::GaussianCloud cloud_;
  std::vector<std::uint32_t> part_;
  std::vector<Touch> touches_;
};

double level(DVec2) { return 0; }

Standing on_a_floor(double unit = 1) {
  Standing block(DVec3(0.0), unit);
  block.add_floor(-1.5, 3, level);
  return block;
}

TEST(Stance, TellsHowFarAPartIsOffTheFloorItIsMovedAlong) {
  const auto footings = on_a_floor().after({1.2, 0.03, 0.1});
  ASSERT_TRUE(footings);
  EXPECT_NEAR(footings->before.normal.y, 1, 1e-6);
  EXPECT_EQ(footings->before.normal, footings->after.normal) << "one plane";
  EXPECT_NEAR(footings->after.height - footings->before.height, 0.03, 1e-6);
  EXPECT_NEAR(glm::distance(footings->after.foot - footings->before.foot, DVec3(1.2, 0.03, 0.1)), 0, 1e-6);
}

TEST(Stance, IsTheSameInAnyUnits) {
  for (const double unit : {1e-3, 1e3}) {
    const auto footings = on_a_floor(unit).after({1.2, 0.03, 0.1});
    ASSERT_TRUE(footings) << unit;
    EXPECT_NEAR((footings->after.height - footings->before.height) / unit, 0.03, 1e-4) << unit;
  }
}

TEST(Stance, LooksAtTheSurfaceAmongWhatNobodyHasSeenBelowIt) {
  Standing block = on_a_floor();
  block.lies_below(0.4, 300);
  const auto footings = block.after({1.2, -0.04, 0});
  ASSERT_TRUE(footings);
  EXPECT_GT(footings->after.normal.y, 0.999);
  EXPECT_NEAR(footings->after.height - footings->before.height, -0.04, 0.01);
}

TEST(Stance, OfAThinPartThatSinksBelowTheFloorIsOnItsUpperSide) {
  Standing board(DVec3(0.0), 1, 1);
  board.add_floor(-1.5, 3, level);
  const auto footings = board.after({1.2, -0.12, 0});  // it was 0.05 above the floor
  ASSERT_TRUE(footings);
  EXPECT_NEAR(footings->after.normal.y, 1, 1e-6);
  EXPECT_NEAR(footings->before.height, 0.05, 1e-6);
  EXPECT_NEAR(footings->after.height, -0.07, 1e-6);
}

TEST(Stance, LooksPastWhatHardlyShows) {
  Standing block = on_a_floor();
  Rng rng(3);
  const auto in_the_way = [&] {
    return DVec3(rng.uniform(-0.5f, 1.7f), rng.uniform(0, 0.2f), rng.uniform(-0.5f, 0.5f));
  };
  for (int k = 0; k < 20'000; ++k) block.add(in_the_way(), -9);
  block.add_to_part({0, 40, 0}, -5);  // a floater that a mask has caught
  const auto footings = block.after({1.2, 0.03, 0.1});
  ASSERT_TRUE(footings);
  EXPECT_NEAR(footings->after.height - footings->before.height, 0.03, 1e-3);
}

TEST(Stance, IsOnASlopeAlongIt) {
  Standing block(DVec3(0.0));
  block.add_floor(-1.5, 0.8, level);
  block.add_floor(0.8, 3, [](DVec2 at) { return 0.3 * (at.x - 0.8); });
  // The middle of its feet arrives 0.05 above the slope, where it was 0.05 above the floor.
  const auto footings = block.after({1.8, 0.3 + 0.02, 0});
  ASSERT_TRUE(footings);
  EXPECT_NEAR(footings->before.normal.y, 1, 1e-3);
  EXPECT_NEAR(footings->after.normal.x / footings->after.normal.y, -0.3, 0.02);
}

TEST(Stance, OfABallThatRollsOverACrownIsWhereItTouches) {
  constexpr double crown = 2, radius = 0.3;
  scene::GaussianCloud cloud;
  std::vector<std::uint32_t> part;
  std::vector<Touch> touches;
  const auto at = [](double angle, double height) {  // of the crown's axis, z
    return height * DVec3(std::sin(angle), std::cos(angle), 0);
  };
  const double way = 0.3, rolled = way * (crown + radius) / radius, miss = 0.01;
  for (int i = 0; i < 3000; ++i) {  // points of a sphere, evenly
    const double y = 1 - (i + 0.5) / 1500, around = 2.399963 * i, wide = std::sqrt(1 - y * y);
    const DVec3 offset = radius * DVec3(wide * std::cos(around), y, wide * std::sin(around));
    part.push_back(std::uint32_t(i));
    touches.push_back(offset.y < -0.8 * radius ? Touch::stands : Touch::nothing);
    add_at(cloud, Vec3(at(0, crown + radius) + offset), 4, std::log(0.03f));
  }
  for (double angle = -1; angle < 1.3; angle += 0.03)
    for (double z = -1; z < 1; z += 0.06) add_at(cloud, Vec3(at(angle, crown) + DVec3(0, 0, z)), 4, std::log(0.03f));
  const scene::LayeredCloud scene{std::make_shared<const scene::GaussianCloud>(cloud), nullptr};
  const DQuat turn = glm::angleAxis(-rolled, DVec3(0, 0, 1));
  const auto footings = Stance(scene, cloud.mean, part, touches, part).after(scene, cloud.mean, [&](DVec3 point) {
    return at(way, crown + radius + miss) + turn * (point - at(0, crown + radius));
  });
  ASSERT_TRUE(footings);
  EXPECT_GT(glm::dot(footings->before.normal, at(0, 1)), 0.99);
  EXPECT_GT(glm::dot(footings->after.normal, at(way, 1)), 0.99);
  EXPECT_NEAR(footings->after.height - footings->before.height, miss, 0.005);
}

TEST(Stance, IsNoneWhereNothingIsStoodOn) {
  EXPECT_FALSE(on_a_floor().after({1.2, 1.5, 0})) << "in the air";
  EXPECT_FALSE(on_a_floor().after({1e30, 0, 0})) << "beyond everything";
  EXPECT_FALSE(Standing(DVec3(0.0)).after({0.1, 0, 0})) << "alone";
  Standing hovering = on_a_floor();
  hovering.touches_nothing();
  EXPECT_FALSE(hovering.after({1.2, 0, 0}));
  Standing in_a_heap(DVec3(0.0));
  Rng rng(1);
  for (int k = 0; k < 4000; ++k)
    in_a_heap.add({double(rng.uniform(-1, 2.5f)), double(rng.uniform(-1, 1)), double(rng.uniform(-1, 1))});
  EXPECT_FALSE(in_a_heap.after({1.2, 0, 0})) << "no plane is in a heap";
}

TEST(Stance, IsNoneWhereAllIsInOnePlace) {
  scene::GaussianCloud cloud = cloud_at({{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 0, 0}});
  const scene::LayeredCloud scene{std::make_shared<const scene::GaussianCloud>(cloud), nullptr};
  const std::vector<std::uint32_t> part{0, 1, 2, 3, 4, 5};
  const Stance stance(scene, cloud.mean, part, std::vector(6, Touch::stands), part);
  EXPECT_FALSE(stance.after(scene, cloud.mean, [](DVec3) { return DVec3(1, 0, 0); }));
}

}  // namespace
}  // namespace engine::select
