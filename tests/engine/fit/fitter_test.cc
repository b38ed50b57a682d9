#include "engine/fit/fitter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"
#include "engine/fit/checkpoint.h"
#include "engine/fit/start.h"
#include "engine/render/forward.h"

namespace engine::fit {
namespace {

/// A scene that is known, photos of it, and points on it.
struct Capture {
  scene::GaussianCloud truth;
  std::vector<Photo> photos;
  std::vector<ColoredPoint> points;

  explicit Capture(int views = 6, int width = 120, int height = 90) {
    truth.sh_degree = 0;
    truth.resize(400);
    Rng rng(1);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      truth.mean.set(i, {rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-1, 1)});
      truth.log_scale.set(i, {rng.uniform(-3, -2), rng.uniform(-3, -2), rng.uniform(-3, -2)});
      truth.rotation.set(i, {rng.normal(), rng.normal(), rng.normal(), rng.normal()});
      truth.opacity_logit[i] = 3;
      for (float& value : truth.sh_row(i)) value = rng.uniform(-1.5f, 1.5f);
      if (i % 4 == 0) points.push_back({DVec3(truth.mean.get(i)), {128, 128, 128}});
    }
    for (int v = 0; v < views; ++v) {
      const double angle = 0.9 * v / views;
      scene::Camera camera = scene::look_at({4 * std::sin(angle), 0.4 * v, -4 * std::cos(angle)}, {0, 0, 0}, {0, -1, 0},
                                            0.8, width, height);
      camera.name = "view_" + std::to_string(v);
      photos.push_back(to_photo(camera, render::forward(truth, camera).color));
    }
  }
  [[nodiscard]] scene::GaussianCloud start() const { return gaussians_at(points, 0); }
};

FitOptions short_fit(int iterations) {
  FitOptions options;
  options.iterations = iterations;
  options.sh_degree = 1;
  options.max_gaussians = 500;
  options.halvings = 0;
  options.densify.every = 20;
  return options;
}

void run(Fitter& fitter, int iterations) {
  for (int i = 0; i < iterations; ++i) ASSERT_TRUE(fitter.step());
}

std::string state_of(const Fitter& fitter) {
  ByteWriter out;
  fitter.write(out);
  return std::move(out).take();
}

TEST(Fitter, ComesNearToThePhotosAndToViewsItHasNotSeen) {
  const Capture capture(8);
  std::vector<Photo> training = capture.photos;
  const std::vector<Photo> held_out{training[3]};
  training.erase(training.begin() + 3);
  Fitter fitter(training, capture.start(), short_fit(400));
  const double before = quality_on(fitter.cloud(), held_out, Vec3(0.0f)).psnr_db;
  run(fitter, 400);
  ASSERT_TRUE(fitter.done());
  EXPECT_GT(quality_on(fitter.cloud(), training, Vec3(0.0f)).psnr_db, before + 7) << "from " << before;
  EXPECT_GT(quality_on(fitter.cloud(), held_out, Vec3(0.0f)).psnr_db, before + 6) << "from " << before;
}

TEST(Fitter, GrowsUpToTheLimitAndGainsBands) {
  const Capture capture;
  Fitter fitter(capture.photos, capture.start(), short_fit(200));
  EXPECT_EQ(fitter.cloud().sh_degree, 0);
  run(fitter, 100);
  const std::size_t half_way = fitter.cloud().size();
  EXPECT_GT(half_way, capture.points.size());
  EXPECT_LT(half_way, 500u);
  run(fitter, 100);
  EXPECT_GT(fitter.cloud().size(), half_way);
  EXPECT_LE(fitter.cloud().size(), 500u);
  EXPECT_EQ(fitter.cloud().sh_degree, 1);
}

TEST(Fitter, MovesPositionsWithASinglePhoto) {
  const Capture capture(1);
  FitOptions options = short_fit(60);
  options.densify.every = 0;
  Fitter fitter(capture.photos, capture.start(), options);
  run(fitter, 60);
  double moved = 0;
  for (std::size_t i = 0; i < capture.points.size(); ++i)
    moved = std::max(moved, glm::distance(DVec3(fitter.cloud().mean.get(i)), capture.points[i].position));
  EXPECT_GT(moved, 1e-3);
}

TEST(Fitter, RemovesWhatNobodySees) {
  const Capture capture;
  scene::GaussianCloud start = capture.start();
  start.opacity_logit[7] = -12;  // fainter than a view can show, so that nothing pulls it up
  FitOptions options = short_fit(20);
  options.densify.gradient = 1e9;  // nothing gets children
  Fitter too_short(capture.photos, start, options);
  options.densify.until = 1;
  Fitter pruned(capture.photos, start, options);
  run(too_short, 20), run(pruned, 20);
  EXPECT_EQ(too_short.cloud().size(), start.size()) << "the only time would have been after densification ended";
  EXPECT_EQ(pruned.cloud().size(), start.size() - 1);
}

TEST(Fitter, LeavesASceneThatIsRightAlone) {
  const Capture capture;
  FitOptions options = short_fit(12);
  options.sh_degree = 0;
  options.densify.every = 0;
  Fitter fitter(capture.photos, capture.truth, options);
  run(fitter, 12);
  // Adam goes where SSIM sees the rounding of the photos; it cannot get far in a few steps.
  EXPECT_GT(quality_on(fitter.cloud(), capture.photos, Vec3(0.0f)).psnr_db, 35);
}

TEST(Fitter, GivesTheSameBytesForAnyNumberOfThreads) {
  const Capture capture;
  std::string one, four;
  for (auto [threads, state] : {std::pair{1, &one}, {4, &four}})
    WorkArena(threads).run([&] {
      Fitter fitter(capture.photos, capture.start(), short_fit(100));
      run(fitter, 60);
      *state = state_of(fitter);
    });
  EXPECT_EQ(one, four);
}

TEST(Fitter, GoesOnFromACheckpointToTheSameBytes) {
  const Capture capture(6, 160, 140);
  FitOptions options = short_fit(100);
  options.halvings = 1;
  Fitter undisturbed(capture.photos, capture.start(), options);
  run(undisturbed, 100);
  // In the middle of an epoch; around children (20), a band (10) and finer photos (30).
  for (const int at : {1, 9, 10, 19, 20, 29, 30, 33, 99}) {
    Fitter first(capture.photos, capture.start(), options);
    run(first, at);
    const History history{12.5, {{at, 3.25, 99, 21.5}}};
    const std::string bytes = encode(42, history, first);
    Fitter second(capture.photos, capture.start(), options);
    const auto back = decode(bytes, 42, second);
    ASSERT_TRUE(back) << back.error().message;
    EXPECT_EQ(*back, history);
    EXPECT_EQ(second.iteration(), at);
    run(second, 100 - at);
    EXPECT_EQ(state_of(second), state_of(undisturbed)) << "interrupted after " << at;
  }
}

TEST(FitCheckpoint, RefusesWhatIsNotItsOwn) {
  const Capture capture(2);
  const FitOptions options = short_fit(10);
  Fitter fitter(capture.photos, capture.start(), options);
  run(fitter, 3);
  const std::string good = encode(42, {}, fitter);
  const auto refusal = [&](const std::string& bytes, std::uint64_t identity = 42) {
    Fitter fresh(capture.photos, capture.start(), options);
    const auto read = decode(bytes, identity, fresh);
    EXPECT_FALSE(read);
    return read ? ErrorCode::busy : read.error().code;
  };
  EXPECT_EQ(refusal(good, 43), ErrorCode::conflict);
  EXPECT_EQ(refusal(""), ErrorCode::corrupt_data);
  EXPECT_EQ(refusal("splatdrag edit, not a fit"), ErrorCode::corrupt_data);
  for (std::size_t cut = 0; cut < good.size(); cut += good.size() / 23)
    EXPECT_EQ(refusal(good.substr(0, cut)), ErrorCode::corrupt_data) << cut;
  for (const std::size_t at : {std::size_t{30}, good.size() / 2, good.size() - 1}) {
    std::string damaged = good;
    damaged[at] = char(damaged[at] ^ 1);
    EXPECT_EQ(refusal(damaged), ErrorCode::corrupt_data) << at;
  }
  std::string newer = good;
  newer[14] = 77;
  EXPECT_EQ(refusal(newer), ErrorCode::unsupported);
}

TEST(FitIdentity, TellsFitsApart) {
  const Capture capture(2);
  const FitOptions options = short_fit(10);
  const std::uint64_t identity = identity_of(capture.photos, capture.start(), options, "AVX2");
  EXPECT_EQ(identity, identity_of(capture.photos, capture.start(), options, "AVX2"));
  auto photos = capture.photos;
  photos[1].rgb[100] ^= 1;
  EXPECT_NE(identity, identity_of(photos, capture.start(), options, "AVX2"));
  photos = capture.photos;
  photos[0].camera.cx += 0.5;
  EXPECT_NE(identity, identity_of(photos, capture.start(), options, "AVX2"));
  auto start = capture.start();
  start.mean.x[0] += 0.5f;
  EXPECT_NE(identity, identity_of(capture.photos, start, options, "AVX2"));
  EXPECT_NE(identity, identity_of(capture.photos, capture.start(), options, "SSE4"));
  const std::vector<void (*)(FitOptions&)> changes{[](FitOptions& o) { ++o.iterations; },
                                                   [](FitOptions& o) { --o.sh_degree; },
                                                   [](FitOptions& o) { ++o.max_gaussians; },
                                                   [](FitOptions& o) { ++o.halvings; },
                                                   [](FitOptions& o) { ++o.seed; },
                                                   [](FitOptions& o) { o.background.y = 1; },
                                                   [](FitOptions& o) { o.rates.position *= 2; },
                                                   [](FitOptions& o) { o.rates.sh_dc *= 2; },
                                                   [](FitOptions& o) { o.rates.sh_rest *= 2; },
                                                   [](FitOptions& o) { o.rates.opacity_logit *= 2; },
                                                   [](FitOptions& o) { o.rates.log_scale *= 2; },
                                                   [](FitOptions& o) { o.rates.rotation *= 2; },
                                                   [](FitOptions& o) { o.rates.last *= 2; },
                                                   [](FitOptions& o) { o.adam.beta1 /= 2; },
                                                   [](FitOptions& o) { o.adam.beta2 /= 2; },
                                                   [](FitOptions& o) { o.adam.epsilon *= 2; },
                                                   [](FitOptions& o) { o.loss.l1_weight *= 2; },
                                                   [](FitOptions& o) { o.loss.ssim_weight *= 2; },
                                                   [](FitOptions& o) { o.loss.l1.scale *= 2; },
                                                   [](FitOptions& o) { o.loss.l1.kind = optim::SmoothL1::charbonnier; },
                                                   [](FitOptions& o) { ++o.densify.every; },
                                                   [](FitOptions& o) { o.densify.until /= 2; },
                                                   [](FitOptions& o) { o.densify.gradient *= 2; },
                                                   [](FitOptions& o) { o.densify.dense *= 2; },
                                                   [](FitOptions& o) { o.least_opacity *= 2; }};
  for (std::size_t i = 0; i < changes.size(); ++i) {
    FitOptions other = options;
    changes[i](other);
    EXPECT_NE(identity, identity_of(capture.photos, capture.start(), other, "AVX2")) << "change " << i;
  }
}

TEST(Fitter, NamesAParameterThatIsNotFinite) {
  const Capture capture(2);
  scene::GaussianCloud start = capture.start();
  start.sh_row(3)[1] = std::numeric_limits<float>::quiet_NaN();
  Fitter fitter(capture.photos, start, short_fit(10));
  const auto step = fitter.step();
  ASSERT_FALSE(step);
  EXPECT_EQ(step.error().code, ErrorCode::internal);
  EXPECT_TRUE(step.error().where.starts_with("gaussian[")) << step.error().where;
}

TEST(StageOf, GoesFromCoarseToFineAndFromFlatToShiny) {
  FitOptions options;
  options.iterations = 1000;
  Phase before = phase_of(options, 0, 0);
  EXPECT_EQ(before, (Phase{options.halvings, 0}));
  for (int i = 1; i < 1000; ++i) {
    const Phase stage = phase_of(options, 0, i);
    EXPECT_LE(stage.halvings, before.halvings);
    EXPECT_GE(stage.sh_degree, before.sh_degree);
    before = stage;
  }
  EXPECT_EQ(before, (Phase{0, 3}));
  EXPECT_EQ(phase_of(options, 2, 0).sh_degree, 2) << "bands that exist are fitted from the beginning";
  options.halvings = 8;
  EXPECT_EQ(phase_of(options, 0, 999).halvings, 0);
}

TEST(ValidateFitOptions, NamesTheWrongOne) {
  EXPECT_TRUE(validate(FitOptions{}));
  const auto where = [](auto spoil) {
    FitOptions options;
    spoil(options);
    const auto valid = validate(options);
    return valid ? std::string("nothing") : valid.error().where;
  };
  EXPECT_EQ(where([](FitOptions& o) { o.iterations = 0; }), "iterations");
  EXPECT_EQ(where([](FitOptions& o) { o.sh_degree = 4; }), "sh_degree");
  EXPECT_EQ(where([](FitOptions& o) { o.max_gaussians = 0; }), "max_gaussians");
  EXPECT_EQ(where([](FitOptions& o) { o.halvings = 9; }), "halvings");
  EXPECT_EQ(where([](FitOptions& o) { o.least_opacity = 1; }), "least_opacity");
  EXPECT_EQ(where([](FitOptions& o) { o.rates.position = 0; }), "rates.position");
}

}  // namespace
}  // namespace engine::fit
