#include "server/edits/speed_log.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>

namespace server::edits {
namespace {

using engine::edit::FrameTime;

struct SpeedLogTest : testing::Test {
  /// What is measured takes `load` times what it should.
  MachineSpeed measure(const std::string& picture = "scene") {
    return log.speed_of(picture, [&] {
      ++frames;
      return FrameTime{2e-3 * load, 1e-8 * load};
    });
  }

  double load = 1;
  int frames = 0;
  SpeedLog log{[this] { return 1.5 * load; }};
};

TEST_F(SpeedLogTest, TellsWhatItMeasured) {
  const MachineSpeed speed = measure();
  EXPECT_DOUBLE_EQ(speed.slowness, 1.5);
  EXPECT_DOUBLE_EQ(speed.frame.gaussians, 2e-3);
  EXPECT_DOUBLE_EQ(speed.frame.pixel, 1e-8);
}

TEST_F(SpeedLogTest, OneMeasurementUnderLoadDoesNotCount) {
  (void)measure();
  load = 4;
  const MachineSpeed known = measure(), another = measure("another scene");
  EXPECT_DOUBLE_EQ(known.slowness, 1.5);
  EXPECT_DOUBLE_EQ(known.now, 1.5 * 4) << "what else was timed now is to be divided by it";
  EXPECT_DOUBLE_EQ(known.frame.gaussians, 2e-3);
  EXPECT_DOUBLE_EQ(another.frame.gaussians, 2e-3) << "the yardstick was slowed down alike";
  EXPECT_DOUBLE_EQ(another.frame.pixel, 1e-8);
}

TEST_F(SpeedLogTest, FollowsAMachineThatHasBecomeSlowerForGood) {
  (void)measure();
  load = 2;
  for (int i = 0; i < 40; ++i) (void)measure();
  EXPECT_DOUBLE_EQ(measure().slowness, 3);
  EXPECT_DOUBLE_EQ(measure().frame.gaussians, 4e-3);
}

TEST_F(SpeedLogTest, RendersTheSamePictureThreeTimesAndNoMore) {
  for (int i = 0; i < 10; ++i) (void)measure();
  EXPECT_EQ(frames, 3);
  (void)measure("another scene");
  EXPECT_EQ(frames, 4);
}

TEST_F(SpeedLogTest, ForgetsPicturesThatNobodyAsksFor) {
  for (int i = 0; i < 10; ++i) (void)measure();
  for (int i = 0; i < 200; ++i) {
    (void)measure("scene " + std::to_string(i));
    if (i % 50 == 0) (void)measure();
  }
  frames = 0;
  (void)measure();
  EXPECT_EQ(frames, 0) << "it was asked for now and then";
  (void)measure("scene 0");
  EXPECT_EQ(frames, 1) << "it was not";
}

TEST(SpeedLog, KnowsAPictureThatOthersPushOutWhileItMeasures) {
  bool is_crowded = false;
  SpeedLog* all = nullptr;
  SpeedLog log([&] {
    if (std::exchange(is_crowded, false))
      for (int i = 0; i < 200; ++i) (void)all->speed_of("scene " + std::to_string(i), [] { return FrameTime{1, 1}; });
    return 1.5;
  });
  all = &log;
  const auto measure = [&] { return log.speed_of("scene", [] { return FrameTime{2e-3, 1e-8}; }); };
  for (int i = 0; i < 3; ++i) (void)measure();
  is_crowded = true;
  const MachineSpeed speed = measure();
  EXPECT_DOUBLE_EQ(speed.frame.gaussians, 2e-3);
  EXPECT_DOUBLE_EQ(speed.frame.pixel, 1e-8);
  EXPECT_EQ(speed.slowness, 1.5);
}

}  // namespace
}  // namespace server::edits
