#include "engine/diffusion/repainter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/rng.h"
#include "engine/weights/safetensors.h"
#include "tests/engine/diffusion/tiny_folder.h"

namespace engine::diffusion {
namespace {

using correct::HistoryPicture;
using correct::RepaintTask;

scene::Image random_picture(int width, int height, std::uint64_t seed) {
  scene::Image picture(width, height, 3);
  Rng rng(seed);
  for (float& value : picture.data) value = rng.uniform();
  return picture;
}

std::vector<HistoryPicture> history() {
  std::vector<HistoryPicture> pictures;
  for (std::uint64_t v = 0; v < 3; ++v)
    pictures.push_back({.view = v, .picture = correct::as_bytes(random_picture(24, 20, v)), .box = {4, 4, 14, 16}});
  return pictures;
}

RepaintTask task(std::uint64_t seed) {
  RepaintTask out{random_picture(24, 20, seed), scene::Mask(24, 20)};
  for (int y = 6; y < 14; ++y)
    for (int x = 5; x < 12; ++x) out.mask.at(x, y) = 1;
  return out;
}

const RepainterOptions quick = {
    .prompt = "a hat", .guidance = 2, .sampling = {Sampler::ddim, 4}, .rank = 2, .batch = 2};

const correct::Advance go_on = [](double) { return Result<void>{}; };

std::unique_ptr<StableDiffusionRepainter> tiny(const RepainterOptions& options = quick) {
  static const TinyFolder folder;
  static const StableDiffusion model = StableDiffusion::open(folder.path()).value();
  return StableDiffusionRepainter::create(model, options).value();
}

TEST(CropAround, ShowsSomeOfWhatIsAroundInTheSizeOfTheNetworks) {
  EXPECT_EQ(crop_around({100, 200, 300, 280}, 512, 384, 512, 64), (Crop{{75, 175, 325, 305}, 512, 256}));
  EXPECT_EQ(crop_around({0, 0, 512, 384}, 512, 384, 512, 64), (Crop{{0, 0, 512, 384}, 512, 384}));
}

TEST(CropAround, MagnifiesFourTimesAtMostAndStaysInsideThePicture) {
  EXPECT_EQ(crop_around({100, 100, 104, 104}, 512, 384, 512, 64), (Crop{{38, 38, 166, 166}, 512, 512}));
  EXPECT_EQ(crop_around({0, 380, 4, 384}, 512, 384, 512, 64), (Crop{{0, 256, 128, 384}, 512, 512}));
  EXPECT_EQ(crop_around({3, 1, 5, 2}, 40, 16, 512, 64), (Crop{{0, 0, 40, 16}, 512, 192})) << "all there is";
}

TEST(CropAround, HasSidesThatTheNetworksTakeWhateverTheBox) {
  Rng rng(1);
  for (int i = 0; i < 500; ++i) {
    const int width = 1 + int(rng.below(300)), height = 1 + int(rng.below(300));
    scene::Rect box{int(rng.below(std::uint32_t(width))), int(rng.below(std::uint32_t(height))), 0, 0};
    box.x1 = box.x0 + 1 + int(rng.below(std::uint32_t(width - box.x0)));
    box.y1 = box.y0 + 1 + int(rng.below(std::uint32_t(height - box.y0)));
    const Crop crop = crop_around(box, width, height, 128, 64);
    ASSERT_TRUE(crop.part.x0 >= 0 && crop.part.y0 >= 0 && crop.part.x1 <= width && crop.part.y1 <= height) << i;
    ASSERT_TRUE(crop.part.x0 <= box.x0 && crop.part.y0 <= box.y0 && crop.part.x1 >= box.x1 && crop.part.y1 >= box.y1)
        << i;
    ASSERT_TRUE(crop.width >= 64 && crop.width <= 128 && crop.width % 64 == 0) << i;
    ASSERT_TRUE(crop.height >= 64 && crop.height <= 128 && crop.height % 64 == 0) << i;
  }
}

TEST(StableDiffusionRepainter, RepaintsEachPictureAroundItsMaskBySeedAndStrength) {
  const auto repainter = tiny();
  const std::vector<RepaintTask> tasks{task(7), task(8)};
  const auto painted = repainter->repaint(tasks, 0.5, 1, go_on);
  ASSERT_TRUE(painted) << painted.error().message;
  ASSERT_EQ(painted->size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    const scene::Image &now = (*painted)[k], &before = tasks[k].picture;
    ASSERT_EQ(now.width, 24);
    ASSERT_EQ(now.height, 20);
    EXPECT_EQ(now.at(23, 19, 0), before.at(23, 19, 0)) << "far from the mask";
    double change = 0;
    for (int y = 6; y < 14; ++y)
      for (int x = 5; x < 12; ++x) change += double(std::abs(now.at(x, y) - before.at(x, y)));
    EXPECT_GT(change, 1);
  }
  EXPECT_EQ(*painted, repainter->repaint(tasks, 0.5, 1, go_on).value());
  EXPECT_NE(*painted, repainter->repaint(tasks, 0.5, 2, go_on).value());
  EXPECT_NE(*painted, repainter->repaint(tasks, 1, 1, go_on).value());
  const std::vector<RepaintTask> alike{task(7), task(7)};
  const auto twice = repainter->repaint(alike, 0.5, 1, go_on);
  ASSERT_TRUE(twice);
  EXPECT_NE((*twice)[0], (*twice)[1]) << "each picture has a seed of its own";
}

TEST(StableDiffusionRepainter, WhatItLearnsChangesWhatItPaintsAndGoesOnFromItsState) {
  const std::vector<RepaintTask> tasks{task(7)};
  const auto undisturbed = tiny();
  const std::string nothing = undisturbed->state();
  const scene::Image blank = undisturbed->repaint(tasks, 1, 1, go_on).value()[0];
  ASSERT_TRUE(undisturbed->fine_tune(history(), 3, 5, go_on));
  const std::string between = undisturbed->state();
  const scene::Image some = undisturbed->repaint(tasks, 1, 1, go_on).value()[0];
  EXPECT_NE(some, blank);
  ASSERT_TRUE(undisturbed->fine_tune(history(), 2, 6, go_on));
  const std::string after = undisturbed->state();
  EXPECT_NE(after, between);

  const auto another = tiny();
  ASSERT_TRUE(another->restore(between));
  EXPECT_EQ(another->state(), between);
  EXPECT_EQ(another->repaint(tasks, 1, 1, go_on).value()[0], some);
  ASSERT_TRUE(another->fine_tune(history(), 2, 6, go_on));
  EXPECT_EQ(another->state(), after) << "the optimiser goes on as well";
  ASSERT_TRUE(another->restore(nothing));
  EXPECT_EQ(another->repaint(tasks, 1, 1, go_on).value()[0], blank);
}

TEST(StableDiffusionRepainter, LearnsWithoutTheAdapterThatItPaintsWith) {
  const TinyFolder folder;
  const StableDiffusion model = StableDiffusion::open(folder.path()).value();
  weights::AdapterWeights few;
  few.unet["mid_block.attentions.0.transformer_blocks.0.attn1.to_q"] = {
      {{1, 8}, std::vector<float>(8, 1.0f)}, {{8, 1}, {1, -1, 2, -2, 3, -3, 4, -4}}, 1.0};
  const auto plain = StableDiffusionRepainter::create(model, quick).value(),
             adapted = StableDiffusionRepainter::create(model.with(few).value(), quick).value();
  for (const auto* repainter : {&plain, &adapted}) ASSERT_TRUE((*repainter)->fine_tune(history(), 3, 5, go_on));
  const auto learned = [](const StableDiffusionRepainter& repainter) {
    const auto file = weights::TensorFile::parse(weights::bytes_of(repainter.state()), "state").value();
    std::vector<float> numbers;
    for (const auto& [name, tensor] : file.tensors()) {
      std::vector<float> values(tensor.elements());
      EXPECT_TRUE(weights::read_floats(tensor, name, values));
      numbers.insert(numbers.end(), values.begin(), values.end());
    }
    return numbers;
  };
  EXPECT_EQ(learned(*adapted), learned(*plain));
  EXPECT_NE(adapted->state(), plain->state()) << "its digest is another";
  EXPECT_NE(adapted->repaint(std::vector{task(7)}, 1, 1, go_on).value(),
            plain->repaint(std::vector{task(7)}, 1, 1, go_on).value());
  EXPECT_EQ(adapted->restore(plain->state()).error().code, ErrorCode::conflict);
}

TEST(StableDiffusionRepainter, LearnsByItsSeedAndByAllOfTheHistory) {
  const auto state_after = [](const std::vector<HistoryPicture>& pictures, std::uint64_t seed) {
    const auto repainter = tiny();
    EXPECT_TRUE(repainter->fine_tune(pictures, 4, seed, go_on));
    return repainter->state();
  };
  const std::string usual = state_after(history(), 5);
  EXPECT_EQ(state_after(history(), 5), usual);
  EXPECT_NE(state_after(history(), 6), usual);
  for (std::size_t k = 0; k < 3; ++k) {
    auto pictures = history();
    for (std::uint8_t& value : pictures[k].picture.data) value = std::uint8_t(255 - value);
    EXPECT_NE(state_after(pictures, 5), usual) << k;
  }
  auto pictures = history();
  for (HistoryPicture& picture : pictures) picture.box = {8, 0, 24, 9};
  EXPECT_NE(state_after(pictures, 5), usual) << "what is repainted is also seen as it is when it is";
  for (HistoryPicture& picture : pictures) picture.box = {};
  EXPECT_NE(state_after(pictures, 5), usual) << "without a box pictures are seen whole";
}

TEST(StableDiffusionRepainter, NothingIsLearnedInNoStepsOrFromNothing) {
  const auto repainter = tiny();
  const std::string nothing = repainter->state();
  ASSERT_TRUE(repainter->fine_tune(history(), 0, 5, go_on));
  ASSERT_TRUE(repainter->fine_tune({}, 5, 5, go_on));
  EXPECT_EQ(repainter->state(), nothing);
}

TEST(StableDiffusionRepainter, DoesNotGoOnWhereTheFilesHaveChanged) {
  const TinyFolder changed;
  const std::string unet = support::read_file(changed.path() / "unet/diffusion_pytorch_model.safetensors");
  std::string other_unet = unet;
  other_unet[other_unet.size() - 3] ^= 1;  // in the last number's mantissa
  const std::string merges = "#version: 0.2\na t</w>\nb t</w>\n";
  const std::string noise = R"({"beta_schedule":"scaled_linear","beta_start":0.00085,"beta_end":0.0121})";
  const auto learned = tiny(), blank = tiny();
  ASSERT_TRUE(learned->fine_tune(history(), 1, 5, go_on));
  for (const auto& [file, bytes] :
       {std::pair<std::string, std::string>{"unet/diffusion_pytorch_model.safetensors", other_unet},
        {"tokenizer/merges.txt", merges},
        {"scheduler/scheduler_config.json", noise}}) {
    const TinyFolder folder;
    folder.write(file, bytes);
    const auto repainter =
        StableDiffusionRepainter::create(StableDiffusion::open(folder.path()).value(), quick).value();
    for (const std::string& state : {learned->state(), blank->state()}) {
      const auto restored = repainter->restore(state);
      ASSERT_FALSE(restored) << file;
      EXPECT_EQ(restored.error().code, ErrorCode::conflict);
      EXPECT_EQ(restored.error().where, "checkpoint");
    }
  }
  const auto same = StableDiffusionRepainter::create(StableDiffusion::open(changed.path()).value(), quick).value();
  EXPECT_TRUE(same->restore(learned->state())) << "the same bytes in another place";
}

TEST(StableDiffusionRepainter, RefusesAStateThatIsNotItsOwn) {
  const auto repainter = tiny();
  ASSERT_TRUE(repainter->fine_tune(history(), 1, 5, go_on));
  const std::string state = repainter->state();
  RepainterOptions options = quick;
  options.rank = 3;
  EXPECT_EQ(tiny(options)->restore(state).error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(tiny()->restore(state.substr(0, state.size() / 2)).error().code, ErrorCode::corrupt_data);
  EXPECT_EQ(tiny()->restore("anything").error().where, "checkpoint");
  ASSERT_TRUE(tiny()->restore(state));
}

TEST(StableDiffusionRepainter, IsCancelledBeforeAnyBlockOfANetworkOnTheWayBackToo) {
  const auto repainter = tiny();
  const std::vector<RepaintTask> tasks{task(7), task(8)};
  std::vector<double> told;  // but for what was told before
  int asked = 0;
  const correct::Advance listen = [&](double part) {
    if (told.empty() || told.back() != part) told.push_back(part);
    ++asked;
    return Result<void>{};
  };
  const auto expect_rising = [&](std::size_t count) {
    ASSERT_EQ(told.size(), count);
    for (std::size_t k = 0; k < count; ++k) EXPECT_TRUE(told[k] >= 0 && told[k] < 1) << k;
    EXPECT_TRUE(std::ranges::is_sorted(told));
    told.clear();
  };
  const auto enough_after = [](int times) {
    return [left = times](double) mutable -> Result<void> {
      if (--left > 0) return {};
      EXPECT_EQ(left, 0) << "nothing is asked after it";
      return fail(ErrorCode::cancelled, "enough");
    };
  };
  ASSERT_TRUE(repainter->fine_tune(history(), 1, 5, listen));
  expect_rising(2);  // pictures of a step
  const int in_step = asked;
  constexpr int blocks = 2 * 2 + 4 + 3 + 1 + 2 * 3 + 3 + 2, transformers = 11;  // roughly: resnets and what is between
  EXPECT_GT(in_step, 2 * (blocks + 2 * transformers)) << "transformers are computed on both ways";
  asked = 0;
  ASSERT_TRUE(repainter->repaint(tasks, 0.5, 1, listen));
  expect_rising(2 * 4);  // of each picture: encoder, two calls of the UNet, decoder
  EXPECT_GT(asked, 2 * 2 * (blocks + transformers));
  for (int times = 1; times <= in_step; ++times)
    ASSERT_EQ(repainter->fine_tune(history(), 1, 5, enough_after(times)).error().code, ErrorCode::cancelled) << times;
  for (int times = 1; times <= asked; ++times)
    ASSERT_EQ(repainter->repaint(tasks, 0.5, 1, enough_after(times)).error().code, ErrorCode::cancelled) << times;
}

TEST(StableDiffusionRepainter, OptionsAreCheckedByName) {
  const weights::NoiseConfig noise;
  EXPECT_TRUE(validate(RepainterOptions{}, noise));
  const auto where = [&](void (*change)(RepainterOptions&)) {
    RepainterOptions options;
    change(options);
    const auto valid = validate(options, noise);
    return valid ? "accepted" : valid.error().where;
  };
  EXPECT_EQ(where([](auto& o) { o.rank = 0; }), "rank");
  EXPECT_EQ(where([](auto& o) { o.batch = 65; }), "batch");
  EXPECT_EQ(where([](auto& o) { o.guidance = 0.5; }), "guidance");
  EXPECT_EQ(where([](auto& o) { o.sampling.steps = 0; }), "steps");
  EXPECT_EQ(where([](auto& o) { o.learning_rate = 0; }), "learning_rate");
}

TEST(RepainterSeconds, GrowWithTheNetworksAndWithWhatIsAsked) {
  const weights::Configs full = weights::stable_diffusion_1();
  const RepainterSeconds usual = seconds_of(full, {});
  // Those that were measured: docs/stable-diffusion.md.
  EXPECT_NEAR(usual.training_step, 4 * 29, 1);
  EXPECT_NEAR(usual.full_strength, 20 * 17, 1);
  EXPECT_NEAR(usual.picture, 25, 0.1);
  EXPECT_LT(seconds_of(full, {.guidance = 1}).full_strength, 0.6 * usual.full_strength);
  EXPECT_LT(seconds_of(weights::tiny_configs(), {}).training_step, 0.01 * usual.training_step);
}

TEST(RepainterBytes, GrowWithTheNetworksTheirPicturesAndTheAdapter) {
  weights::Configs full = weights::stable_diffusion_1();
  const RepainterBytes usual = bytes_of(full, {});
  EXPECT_NEAR(double(usual.networks), 4 * 1066.2e6 + 16 * 4 * 0.8e6, 3e6) << "float32, and an adapter of rank 4";
  EXPECT_GT(usual.learning, usual.painting);
  const RepainterBytes of_rank_256 = bytes_of(full, {.rank = 256});
  EXPECT_NEAR(double(of_rank_256.networks - usual.networks), 63 * 16 * 4 * 0.8e6, 3e7);
  full.unet.sample_side = 128;
  EXPECT_NEAR(double(bytes_of(full, {}).learning), 4 * double(usual.learning), 1);
  EXPECT_EQ(bytes_of(full, {}).networks, usual.networks);
  full.unet.sample_side = 1;
  full.unet.channels.resize(8, 1280), full.unet.heads.resize(8, 8);
  full.unet.down_attends.resize(8, false), full.unet.up_attends.resize(8, true);
  ASSERT_EQ(weights::picture_side(full), 1024) << "that of its levels, not of what it was trained on";
  EXPECT_NEAR(double(bytes_of(full, {}).learning), 4 * double(usual.learning), 1);
  const weights::Configs tiny = weights::tiny_configs();
  EXPECT_LT(bytes_of(tiny, {}).networks + bytes_of(tiny, {}).learning, usual.networks / 10);
}

}  // namespace
}  // namespace engine::diffusion
