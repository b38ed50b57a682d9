#include "server/cli/request_file.h"

#include <gtest/gtest.h>

#include "tests/proto/examples.h"

namespace server::cli {
namespace {

using engine::ErrorCode;

TEST(RequestFile, IsReadFromDisk) {
  const support::TempDir folder;
  support::write_file(folder.path() / "drags.json", proto::example("named_requests.json"));
  const auto request = read_request(folder.path() / "drags.json", "ball_right");
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->request.handles[0].radius, 0.22);
}

TEST(RequestFile, PutsTheFileBeforeTheAddress) {
  const support::TempDir folder;
  const auto file = folder.path() / "drag.json";
  const auto where = [&](const std::string& text, const std::string& name) {
    support::write_file(file, text);
    const auto request = read_request(file, name);
    return request ? "no error" : request.error().where;
  };
  EXPECT_EQ(where(R"({"handles": [{"source": [0, 0, 0], "radius": 0}]})", ""), "drag.json:handles[0].radius");
  EXPECT_EQ(where(R"({"a": {"handles": []}, "b": {"handles": []}})", "b"), "drag.json:b.handles");
  EXPECT_EQ(where("{\n7}", ""), "drag.json:line 2, column 1");
  EXPECT_EQ(where("[]", ""), "drag.json");
}

TEST(RequestFile, RefusesAFileThatIsTooLargeOrAbsent) {
  const support::TempDir folder;
  support::write_file(folder.path() / "big.json", std::string(std::size_t{3} << 20, ' '));
  EXPECT_EQ(read_request(folder.path() / "big.json", "").error().code, ErrorCode::too_large);
  EXPECT_EQ(read_request(folder.path() / "none.json", "").error().code, ErrorCode::not_found);
  EXPECT_EQ(read_request(folder.path(), "").error().code, ErrorCode::invalid_argument);
}

TEST(SelectionFile, IsReadAndNamesItsFileInErrors) {
  const support::TempDir folder;
  const auto file = folder.path() / "part.json";
  support::write_file(file, R"({"selection": [{"rows": [[0, 3]]}]})");
  const auto selection = read_selection(file, "");
  ASSERT_TRUE(selection) << selection.error().message;
  EXPECT_EQ(selection->size(), 1u);
  support::write_file(file, R"({"selection": [{"rows": [[0, -3]]}]})");
  ASSERT_FALSE(read_selection(file, ""));
  EXPECT_EQ(read_selection(file, "").error().where, "part.json:selection[0].rows[0][1]");
}

}  // namespace
}  // namespace server::cli
