#include "engine/evaluate/result_key.h"

#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <vector>

namespace engine::evaluate {
namespace {

ResultOf sample_of() {
  return {.subject = "slide",
          .corrector = "scene",
          .scene = "",
          .dataset = "",
          .pictures = 1,
          .threads = 2,
          .simd = "AVX2",
          .lpips = {},
          .repainter = {},
          .program = 7};
}

edit::Request sample_request() {
  edit::Request request;
  request.handles = {{.source = {0.1, 0.2, 0.3}, .target = DVec3(1, 2, 3), .radius = 0.5, .group = 0}};
  request.region = edit::Region{{0, 0, 0}, {1, 1, 1}};
  return request;
}

TEST(ResultKey, BeginsWithWhatItIsOf) {
  const std::string key = result_key(sample_of(), sample_request());
  EXPECT_TRUE(key.starts_with("slide-scene-")) << key;
  EXPECT_EQ(key.size(), std::string("slide-scene-").size() + 16);
  EXPECT_EQ(key.find_first_not_of("0123456789abcdef", 12), std::string::npos) << key;
  EXPECT_EQ(key, result_key(sample_of(), sample_request()));
}

TEST(ResultKey, IsAnotherWhereAnythingIs) {
  using Of = std::function<void(ResultOf&)>;
  using Asked = std::function<void(edit::Request&)>;
  std::set<std::string> keys{result_key(sample_of(), sample_request())};
  const std::vector<Of> changes{[](auto& of) { of.subject = "speck"; }, [](auto& of) { of.corrector = "none"; },
                                [](auto& of) { of.scene = "a.ply"; },   [](auto& of) { of.dataset = "a.ply"; },
                                [](auto& of) { of.pictures = 2; },      [](auto& of) { of.threads = 1; },
                                [](auto& of) { of.simd = "SSE4"; },     [](auto& of) { of.program = 8; },
                                [](auto& of) { of.lpips = "0123"; },    [](auto& of) { of.repainter = "4567"; }};
  for (const Of& change : changes) {
    ResultOf of = sample_of();
    change(of);
    keys.insert(result_key(of, sample_request()));
  }
  const std::vector<Asked> requests{[](auto& r) { r.params.intervals = 3; },
                                    [](auto& r) { r.params.iterations = 3; },
                                    [](auto& r) { r.params.annealing_steps = 3; },
                                    [](auto& r) { r.params.views = 3; },
                                    [](auto& r) { r.params.max_image_side = 300; },
                                    [](auto& r) { r.params.interpolation = edit::Interpolation::rigid; },
                                    [](auto& r) { r.params.local_mask = false; },
                                    [](auto& r) { r.mode = edit::Mode::extend; },
                                    [](auto& r) { r.handles[0].radius += 1e-15; },
                                    [](auto& r) { r.handles[0].group = 1; },
                                    [](auto& r) { r.handles[0].source.z = 0.4; },
                                    [](auto& r) { r.handles[0].target->x = 1.5; },
                                    [](auto& r) { r.handles[0].target.reset(); },
                                    [](auto& r) { r.handles.push_back(r.handles[0]); },
                                    [](auto& r) { r.selected = {0}; },
                                    [](auto& r) { r.selected = {1}; },
                                    [](auto& r) {
                                      r.selected = {0, 1};
                                    },
                                    [](auto& r) { r.region->size.y = 2; },
                                    [](auto& r) { r.region.reset(); }};
  for (const Asked& change : requests) {
    edit::Request request = sample_request();
    change(request);
    keys.insert(result_key(sample_of(), request));
  }
  EXPECT_EQ(keys.size(), 1 + changes.size() + requests.size());
}

TEST(ResultKey, TellsAnAnchorFromAHandleThatStays) {
  edit::Request stays = sample_request(), anchor = sample_request();
  stays.handles[0].target = stays.handles[0].source;
  anchor.handles[0].target.reset();
  EXPECT_NE(result_key(sample_of(), stays), result_key(sample_of(), anchor));
}

TEST(ResultKey, KnowsItsProgram) { EXPECT_EQ(checksum_of_program(), checksum_of_program()); }

}  // namespace
}  // namespace engine::evaluate
