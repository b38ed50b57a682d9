#include "server/edits/interval_pictures.h"

#include <gtest/gtest.h>

#include "tests/engine/edit/samples.h"
#include "tests/engine/jobs/jobs_support.h"
#include "tests/support/data.h"

namespace server::edits {
namespace {

using engine::edit::Moment;
using engine::jobs::code_of;
using engine::jobs::value;

class IntervalPicturesTest : public testing::Test {
 protected:
  /// The scene without its first rows.
  static engine::scene::Overlay without(std::uint32_t rows) {
    engine::scene::Overlay overlay;
    overlay.rows.sh_degree = 2;
    overlay.rows.extra_stride = 5;
    for (std::uint32_t row = 0; row < rows; ++row) overlay.removed.push_back(row);
    return overlay;
  }
  Moment moment(int interval, const std::string& stage, const engine::scene::Overlay& overlay) const {
    return {.interval = interval, .intervals = 9, .stage = stage, .overlay = overlay, .views = views};
  }
  std::string picture(int interval, std::size_t view, const std::string& stage) const {
    return support::read_file(folder / picture_name(interval, view, stage));
  }

  support::TempDir dir;
  std::filesystem::path folder = dir.path() / "not/there/yet";
  engine::scene::GaussianCloud input = engine::edit::ball_before_wall(100);
  std::vector<engine::scene::Camera> views = engine::edit::arc_of_cameras(3, 40);
};

TEST_F(IntervalPicturesTest, ShowsTheFirstViewsAtEachMoment) {
  IntervalPictures pictures(folder, input, 2);
  const auto untouched = without(0), changed = without(100);
  value(pictures.add(moment(1, "before", untouched)));
  value(pictures.add(moment(1, "deformed", changed)));
  const auto renders = pictures.of(1);
  ASSERT_EQ(renders.size(), 2u);
  EXPECT_EQ(renders[1].view, "view_1");
  EXPECT_EQ(renders[1].stages, (std::vector<std::string>{"before", "deformed"}));
  EXPECT_NE(picture(1, 0, "before"), picture(1, 1, "before"));
  EXPECT_NE(picture(1, 0, "before"), picture(1, 0, "deformed"));
  EXPECT_FALSE(std::filesystem::exists(folder / picture_name(1, 2, "before")));
}

TEST_F(IntervalPicturesTest, AnotherRunWritesTheSameBytes) {
  const auto some = without(30), more = without(60);
  IntervalPictures whole(folder, input, 3);
  value(whole.add(moment(1, "before", without(0))));
  value(whole.add(moment(1, "deformed", some)));
  value(whole.add(moment(2, "before", some)));
  value(whole.add(moment(2, "deformed", more)));
  const auto first = picture(2, 2, "before"), last = picture(2, 2, "deformed");
  IntervalPictures resumed(folder, input, 3);
  value(resumed.add(moment(2, "before", some)));
  value(resumed.add(moment(2, "deformed", more)));
  EXPECT_EQ(picture(2, 2, "before"), first);
  EXPECT_EQ(picture(2, 2, "deformed"), last);
  EXPECT_EQ(resumed.of(2)[0].stages, whole.of(2)[0].stages);
  EXPECT_TRUE(resumed.of(1).empty());
}

TEST_F(IntervalPicturesTest, TakesWhatViewsThereAre) {
  IntervalPictures many(folder, input, 100);
  value(many.add(moment(1, "before", without(0))));
  EXPECT_EQ(many.of(1).size(), 3u);
  views.clear();
  IntervalPictures none(folder / "none", input, 4);
  value(none.add(moment(1, "before", without(0))));
  EXPECT_TRUE(none.of(1).empty());
}

TEST_F(IntervalPicturesTest, AFullDiskIsAnErrorThatSaysWhatToDo) {
  IntervalPictures pictures(folder, input, 1);
  const auto untouched = without(0);
  engine::Error error;
  {
    const engine::jobs::FullDisk full(100);
    const auto added = pictures.add(moment(3, "before", untouched));
    ASSERT_FALSE(added);
    error = added.error();
  }
  EXPECT_EQ(error.code, engine::ErrorCode::no_space);
  EXPECT_NE(error.message.find("pictures of interval 3"), std::string::npos) << error.message;
  EXPECT_NE(error.message.find("free some space"), std::string::npos) << error.message;
  EXPECT_EQ(error.where, "");
  EXPECT_TRUE(pictures.of(3).empty());
  value(pictures.add(moment(3, "before", untouched)));
}

}  // namespace
}  // namespace server::edits
