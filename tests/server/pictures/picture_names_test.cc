#include "server/pictures/picture_names.h"

#include <gtest/gtest.h>

namespace server::pictures {
namespace {

std::vector<std::string> names_of(const std::vector<std::string>& views) {
  std::vector<engine::scene::Camera> cameras;
  for (const std::string& view : views) cameras.emplace_back().name = view;
  return picture_names(cameras);
}

using Names = std::vector<std::string>;

TEST(PictureNames, AreTheViewsWithoutTheirExtension) {
  EXPECT_EQ(names_of({"0001.jpg", "virtual_07", "a.b.png", ".hidden"}),
            (Names{"0001", "virtual_07", "a.b", ".hidden"}));
}

TEST(PictureNames, LeadIntoNoOtherFolder) {
  EXPECT_EQ(names_of({"left/0001.jpg", "../0001.jpg", "/etc/x.png", "a\\b.png"}),
            (Names{"left_0001", ".._0001", "_etc_x", "a_b"}));
}

TEST(PictureNames, AllDiffer) {
  EXPECT_EQ(names_of({"1.jpg", "1.png", "1", "1"}), (Names{"1", "1.png", "1_2", "1_3"}));
  EXPECT_EQ(names_of({"a/b.png", "a_b.png", "", ""}), (Names{"a_b", "a_b.png", "view", "view_2"}));
}

}  // namespace
}  // namespace server::pictures
