// A number that is none comes up while an edit optimises: the edit fails with its name, and no scene holds it.
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <limits>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>

#include "engine/optim/perceptual.h"
#include "tests/server/edits/service_support.h"

namespace server::edits {
namespace {

/// Nothing to say for `good` evaluations, then gradients that are not numbers.
class Poison final : public engine::optim::PerceptualLoss {
 public:
  explicit Poison(int good) : left_(good) {}
  Result<double> evaluate(const engine::scene::Image& rendered, const engine::scene::Image&,
                          engine::scene::Image& v_rendered) override {
    const float v = left_-- > 0 ? 0.0f : std::numeric_limits<float>::quiet_NaN();
    v_rendered = engine::scene::Image(rendered.width, rendered.height, rendered.channels, v);
    return 0.0;
  }

 private:
  int left_;
};

/// Throws what no client should read.
class Thrower final : public engine::optim::PerceptualLoss {
 public:
  Result<double> evaluate(const engine::scene::Image&, const engine::scene::Image&, engine::scene::Image&) override {
    throw std::runtime_error("0x7f0ded secret of the heap");
  }
};

TEST(EditPoison, WhatALibraryThrowsGoesToTheLogAndNotToTheClient) {
  const support::TempDir dir;
  const auto store = open_scenes(dir.path());
  proto::EditRequest request = move_ball(add_ball(*store, dir.path()));
  request.params.iterations = 2;
  Thrower thrower;
  std::ostringstream text;
  spdlog::logger logger("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(text));
  {
    const auto service = value(EditService::open(*store, {.folder = dir.path() / "edits",
                                                          .pictured_views = 2,
                                                          .threads = 1,
                                                          .logger = &logger,
                                                          .perceptual = &thrower}));
    const auto ended = wait_for_end(*service, value(service->submit(request, "")).status.id);
    EXPECT_EQ(ended.state, "failed");
    ASSERT_TRUE(ended.error);
    EXPECT_EQ(ended.error->code, ErrorCode::internal);
    EXPECT_EQ(ended.error->message.find("heap"), std::string::npos) << ended.error->message;
  }
  EXPECT_NE(text.str().find("bug: 0x7f0ded secret of the heap"), std::string::npos) << text.str();
}

TEST(EditPoison, EndsTheEditWithTheNameOfAParameterAndPublishesNothing) {
  constexpr int iterations = 6;
  for (const int good : {0, 4, iterations + 3}) {
    SCOPED_TRACE(good);
    const support::TempDir dir;
    const auto store = open_scenes(dir.path());
    const std::string scene = add_ball(*store, dir.path());
    const std::string before = version_bytes(*store, scene, 0);
    Poison poison(good);
    proto::EditRequest request = move_ball(scene);
    request.params.iterations = iterations;
    std::string id;
    {
      const auto service = value(EditService::open(
          *store, {.folder = dir.path() / "edits", .pictured_views = 2, .threads = 1, .perceptual = &poison}));
      id = value(service->submit(request, "")).status.id;
      const auto ended = wait_for_end(*service, id);
      EXPECT_EQ(ended.state, "failed");
      ASSERT_TRUE(ended.error);
      EXPECT_EQ(ended.error->code, ErrorCode::internal);
      EXPECT_TRUE(ended.error->where.starts_with("gaussian[")) << ended.error->where;
      EXPECT_NE(ended.error->where.find("]."), std::string::npos) << ended.error->where;
      EXPECT_FALSE(ended.result_version);
      EXPECT_EQ(ended.finished_intervals.size(), good > iterations ? 1u : 0u);
    }
    ASSERT_EQ(value(store->find(scene)).versions.size(), 1u);
    EXPECT_EQ(version_bytes(*store, scene, 0), before);

    // Nothing of it is left for those that come after: not in the record, and not in the scene.
    const auto service = open_service(*store, dir.path());
    EXPECT_EQ(value(service->find(id)).state, "failed");
    const auto done = wait_for_end(*service, value(service->submit(request, "")).status.id);
    EXPECT_EQ(done.state, "succeeded");
    EXPECT_FALSE(engine::scene::first_not_finite(
        engine::scene::flatten(value(store->load(scene, std::to_string(*done.result_version))).cloud)));
  }
}

}  // namespace
}  // namespace server::edits
