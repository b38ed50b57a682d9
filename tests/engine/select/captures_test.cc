// Growing on trained captures from the few clicks that a person makes. Nobody knows the rows of their things: the
// counts are of selections that were looked at in several views. leak_at_extent was chosen on the doll, and so was how
// much smaller things are preferred.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "engine/io/scene_file.h"
#include "engine/select/select.h"
#include "tests/support/data.h"

namespace engine::select {
namespace {

/// How many rows of a scene of the shared data grow from these clicks; 0 where the scene cannot be read.
std::size_t grown(const std::filesystem::path& file, const Grow& clicks) {
  const auto scene = io::read_scene(file);
  if (!scene) return ADD_FAILURE() << scene.error().message, 0;
  const auto found = select(scene->cloud, {{Op::add, clicks}});
  if (!found) return ADD_FAILURE() << found.error().message, 0;
  return found->count;
}

TEST(GrowOnTheFox, TakesWhatTheClicksSpan) {
  const auto file = support::data_dir() / "fox" / "point_cloud.ply";
  REQUIRE_SHARED(file);
  const DVec3 ear_tip(2.50, -1.46, 1.60), ear_foot(2.24, -0.88, 1.93), snout(1.30, 0.42, 1.32), nose(1.73, 0.40, 1.47);
  const std::size_t ear = grown(file, {{ear_tip, ear_foot}, {}, {}});
  EXPECT_GT(ear, 1000u);
  EXPECT_LT(ear, 2500u) << "the ear, not the whole head (10,000)";
  const std::size_t tip = grown(file, {{snout, nose}, {}, {}});
  EXPECT_GT(tip, 400u);
  EXPECT_LT(tip, 1200u) << "the snout, not half of the face";
  const std::size_t head = grown(file, {{snout, ear_tip, ear_foot}, {}, {}});
  EXPECT_GT(head, 7000u);
  EXPECT_LT(head, 13000u) << "the head, not its neck and board (24,000)";
  Grow whole{{snout, ear_tip, ear_foot}, {}, {}};
  whole.whole = true;
  const std::size_t whole_head = grown(file, whole);
  EXPECT_GT(whole_head, 7000u);
  EXPECT_LT(whole_head, 13000u) << "no more of it for a page, which means the whole (46,000)";
}

TEST(GrowOnTheDoll, LeavesTheBedThatItSitsOn) {
  const auto file = support::data_dir() / "plush" / "point_cloud.ply";
  REQUIRE_SHARED(file);
  const DVec3 face(-0.955, 0.645, 2.203), left_sleeve(-2.054, 1.473, 3.411), right_sleeve(0.456, 1.662, 2.414);
  const std::size_t doll = grown(file, {{face, left_sleeve, right_sleeve}, {}, {}});
  EXPECT_GT(doll, 20000u) << "of about 26,000";
  EXPECT_LT(doll, 28000u) << "not the quilt and half of the wall (54,000)";
}

TEST(GrowOnTheDoll, TakesNoMoreThanThatTheMoreIsClickedOn) {
  const auto file = support::data_dir() / "plush" / "point_cloud.ply";
  REQUIRE_SHARED(file);
  const DVec3 hair(-1.13, 0.44, 2.21), left_sleeve(-1.24, 1.40, 3.08), right_tail(0.01, 1.43, 2.58),
      left_shoe(-1.60, 2.24, 2.72), right_shoe(-0.38, 2.30, 2.45), right_tip(0.59, 1.92, 2.39),
      left_tail(-2.17, 1.65, 3.42), hat(0.00, -0.43, 2.54);
  Grow whole{{hair, left_sleeve, right_tail, left_shoe, right_shoe, right_tip, left_tail, hat}, {}, {}};
  whole.whole = true;
  const std::size_t doll = grown(file, whole);
  EXPECT_GT(doll, 20000u) << "of about 26,000";
  EXPECT_LT(doll, 28000u) << "not most of the quilt and the wall (60,000)";
}

}  // namespace
}  // namespace engine::select
