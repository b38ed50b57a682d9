#include "server/cli/suggested_drag.h"

#include <gtest/gtest.h>

namespace server::cli {
namespace {

TEST(SuggestedDrag, BecomesTheRequestThatCarriesItOut) {
  const engine::procedural::SuggestedDrag drag{
      "leaf", "extend", {{{1, 2, 3}, engine::DVec3(4, 5, 6), 0.5}, {{7, 8, 9}, std::nullopt, 0.25}}};
  const auto request = proto::parse_edit_request(proto::to_json(to_request(drag)));
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->mode, proto::Mode::extend);
  ASSERT_EQ(request->handles.size(), 2u);
  EXPECT_EQ(request->handles[0].target, (proto::Point{4, 5, 6}));
  EXPECT_EQ(request->handles[1].target, std::nullopt);
  EXPECT_EQ(request->handles[1].radius, 0.25);
}

}  // namespace
}  // namespace server::cli
