#include "server/scenes/disk/public_errors.h"

#include <gtest/gtest.h>

namespace server::scenes {
namespace {

using engine::Error;
using engine::ErrorCode;

TEST(PublicErrors, NamesFilesRelativeToTheFolder) {
  const Error error =
      without_folder({ErrorCode::no_space, "cannot move /srv/data/scenes/a.ply to /srv/data/scenes/s1/base.ply: full",
                      "/srv/data/scenes/s1/base.ply"},
                     "/srv/data/scenes");
  EXPECT_EQ(error.message, "cannot move a.ply to s1/base.ply: full");
  EXPECT_EQ(error.where, "s1/base.ply");
  EXPECT_EQ(error.code, ErrorCode::no_space);
}

TEST(PublicErrors, CallsTheFolderItselfByItsName) {
  EXPECT_EQ(
      without_folder({ErrorCode::internal, "cannot open /srv/data/scenes: no", "/srv/data/scenes"}, "/srv/data/scenes")
          .where,
      "scenes");
}

TEST(PublicErrors, LeavesTheRestAsItIs) {
  const Error error{ErrorCode::internal, "a/b and /c", "handles[2].radius"};
  for (const char* folder : {"", "/", "/srv"}) EXPECT_EQ(without_folder(error, folder).message, error.message);
}

}  // namespace
}  // namespace server::scenes
