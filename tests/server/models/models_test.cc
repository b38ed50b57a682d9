#include "server/models/models.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "engine/params/params.h"
#include "engine/weights/lpips_files.h"
#include "tests/support/data.h"

namespace server::models {
namespace {

namespace fs = std::filesystem;

/// A folder of models that has the tiny checkpoint of the reference.
class ModelFolder {
 public:
  ModelFolder() {
    fs::copy(support::golden_dir() / "tiny_sd", path() / "stable-diffusion", fs::copy_options::recursive);
  }
  [[nodiscard]] const fs::path& path() const { return folder_.path(); }
  /// Files copied from a place where nobody writes are not to be written either.
  void remove(const char* file) const {
    const fs::path full = path() / file;
    fs::permissions(full.parent_path(), fs::perms::owner_all, fs::perm_options::add);
    fs::remove(full);
  }
  ~ModelFolder() {
    for (const auto& entry : fs::recursive_directory_iterator(path()))
      fs::permissions(entry.path(), fs::perms::owner_all, fs::perm_options::add);
  }

 private:
  support::TempDir folder_;
};

TEST(Models, WithoutAFolderNothingIsThereAndBothSayWhatItTakes) {
  const Models none;
  for (const std::string& reason : {none.no_sd(), none.no_lpips()}) {
    EXPECT_TRUE(reason.find("--model-dir") != std::string::npos || reason.find("libtorch-dev") != std::string::npos)
        << reason;
  }
  EXPECT_EQ(none.repainter({}, {}).error().code, engine::ErrorCode::unsupported);
  EXPECT_EQ(none.repainter({}, {}).error().where, "params.corrector");
  EXPECT_EQ(none.lpips().error().where, "params.perceptual");
  EXPECT_EQ(none.cost({}, "").training_step, 0);
  EXPECT_TRUE(none.loras().empty());
  EXPECT_EQ(none.lpips_cost().pixel_seconds, 0);
}

TEST(Models, AnEmptyFolderIsToldWhereFilesGoAndClientsAreNot) {
  const support::TempDir folder;
  const Models models(folder.path());
  ASSERT_EQ(models.findings().size(), 2u);
  for (const Finding& finding : models.findings()) {
    EXPECT_FALSE(finding.usable);
    if (models.no_sd().find("libtorch") == std::string::npos) {
      EXPECT_NE(finding.message.find(folder.path().string()), std::string::npos) << finding.message;
    }
  }
  for (const std::string& reason : {models.no_sd(), models.no_lpips()}) {
    EXPECT_FALSE(reason.empty());
    EXPECT_EQ(reason.find(folder.path().string()), std::string::npos) << "a folder of this machine: " << reason;
  }
}

TEST(Models, ACheckpointIsFoundLookedAtAndUsed) {
  REQUIRE_SHARED(support::golden_dir() / "tiny_sd");
  const ModelFolder folder;
  const Models models(folder.path(), /*threads=*/1);
  if (models.no_sd().find("libtorch") != std::string::npos) GTEST_SKIP() << models.no_sd();
  ASSERT_EQ(models.no_sd(), "");
  EXPECT_TRUE(models.findings()[0].usable);
  EXPECT_FALSE(models.findings()[1].usable) << "there is no LPIPS";
  engine::params::Params params;
  const auto repainter = models.repainter(params, {"a hat", ""});
  ASSERT_TRUE(repainter) << repainter.error().message;
  const RepainterCost usual = models.cost(params, "");
  EXPECT_GT(usual.training_step, 0);
  EXPECT_GT(usual.network_bytes, std::uint64_t{1} << 20);
  EXPECT_LT(usual.network_bytes + usual.learning_bytes, std::uint64_t{100} << 20) << "it is a tiny one";
  params.lora_rank = 64;
  EXPECT_GT(models.cost(params, "").network_bytes, usual.network_bytes) << "the adapter is of a higher rank";
  params.sampling_steps = 40;
  EXPECT_NEAR(models.cost(params, "").full_strength, 2 * usual.full_strength, 1e-9);
  params.sampling_steps = 501;
  EXPECT_EQ(models.repainter(params, {}).error().where, "params.sampling_steps");
}

TEST(Models, AdaptersAreFoundByTheirNamesAndTheDamagedOneIsTold) {
  REQUIRE_SHARED(support::golden_dir() / "tiny_sd");
  const ModelFolder folder;
  const fs::path adapters = folder.path() / "lora";
  fs::create_directories(adapters / "published");
  const fs::path golden = support::golden_dir() / "lora";
  const std::string whole = support::read_file(golden / "diffusers_current.safetensors");
  support::write_file(adapters / "few.safetensors", whole);
  support::write_file(adapters / "published/pytorch_lora_weights.safetensors",
                      support::read_file(golden / "kohya_alpha8.safetensors"));
  support::write_file(adapters / "cut.safetensors", whole.substr(0, whole.size() / 2));
  support::write_file(adapters / "notes.txt", "no adapter");
  support::write_file(adapters / ".DS_Store", "of a desktop");
  fs::create_directory(adapters / "published.old");
  for (const char* of_both : {"twice.safetensors", "twice/adapter_model.safetensors", "\xff.safetensors"}) {
    fs::create_directories((adapters / of_both).parent_path());
    support::write_file(adapters / of_both, whole);
  }
  const Models models(folder.path(), /*threads=*/1);
  std::map<std::string, Finding> found;
  for (const Finding& finding : models.findings()) found[finding.name] = finding;
  ASSERT_EQ(found.size(), 9u) << "sd, lpips, four adapters, a name that cannot be asked for, two that are no adapter";
  EXPECT_NE(found["lora notes.txt"].message.find("not a .safetensors file"), std::string::npos);
  EXPECT_FALSE(found["lora twice"].usable);
  EXPECT_NE(found["lora ?"].message.find("rename"), std::string::npos) << found["lora ?"].message;
  EXPECT_FALSE(found["lora cut"].usable);
  EXPECT_NE(found["lora cut"].message.find("cut.safetensors"), std::string::npos) << found["lora cut"].message;
  if (models.no_sd().find("libtorch") != std::string::npos) GTEST_SKIP() << models.no_sd();
  EXPECT_TRUE(found["lora few"].usable);
  EXPECT_TRUE(found["lora published"].usable);
  EXPECT_EQ(models.loras(), (std::vector<std::string>{"few", "published"}));

  const engine::params::Params params;
  const auto state = [&](const std::string& lora) {
    const auto made = models.repainter(params, {.lora = lora});
    return made ? (*made)->state() : made.error().where;
  };
  EXPECT_EQ(state("cut"), "lora");
  EXPECT_EQ(state("none"), "lora");
  EXPECT_NE(state("few"), state("")) << "a resume with another is refused by it";
  EXPECT_NE(state("few"), state("published"));
  const RepainterCost with = models.cost(params, "few"), without = models.cost(params, "");
  EXPECT_GT(with.network_bytes, without.network_bytes);
  EXPECT_GT(with.full_strength, without.full_strength);
  EXPECT_EQ(with.training_step, without.training_step) << "which goes without it";
}

TEST(Models, LpipsIsReadyOnlyIfItsFilesHaveEveryTensor) {
  REQUIRE_SHARED(support::golden_dir() / "lpips_lin");
  const support::TempDir folder;
  fs::create_directory(folder.path() / "lpips");
  const fs::path vgg16 = folder.path() / "lpips/vgg16.safetensors", own = folder.path() / "lpips/vgg_v0.1.safetensors";
  support::write_file(own, support::read_file(support::golden_dir() / "lpips_lin/vgg_v0.1.safetensors"));
  const auto finding = [&](const std::string& bytes) {
    support::write_file(vgg16, bytes);
    return Models(folder.path()).findings()[1];
  };
  const auto zeros = [](bool whole) {
    std::map<std::string, engine::weights::FloatTensor> tensors;
    for (const auto& convolution : engine::weights::vgg_convolutions)
      for (const auto& spec : {engine::weights::vgg_weight(convolution), engine::weights::vgg_bias(convolution)}) {
        std::size_t count = 1;
        for (const std::int64_t size : spec.shape) count *= std::size_t(size);
        if (whole || convolution.place != 28) tensors[spec.name] = {spec.shape, std::vector<float>(count)};
      }
    return engine::weights::encode_tensors(tensors);
  };
  const std::string part = zeros(false), whole = zeros(true);
  for (const auto& [bytes, expected] :
       {std::pair<std::string, std::string>{part, "vgg16.safetensors:features.28.weight"},
        {whole.substr(0, whole.size() - 1), "vgg16.safetensors:"},
        {"", "vgg16.safetensors:header"}}) {
    const Finding found = finding(bytes);
    EXPECT_FALSE(found.usable);
    if (found.message.find("libtorch") == std::string::npos) {
      EXPECT_NE(found.message.find(expected), std::string::npos) << found.message;
    }
  }
  const Finding good = finding(whole);
  if (good.message.find("libtorch") != std::string::npos) GTEST_SKIP() << good.message;
  EXPECT_TRUE(good.usable) << good.message;
  const Models models(folder.path(), 1);
  EXPECT_EQ(models.lpips().value()->identity().size(), 16u);
  EXPECT_GT(models.lpips_cost().pixel_seconds, 0);
}

TEST(Models, WhatIsWrongWithACheckpointIsSaidToWhoInstallsIt) {
  REQUIRE_SHARED(support::golden_dir() / "tiny_sd");
  for (const char* file : {"unet/diffusion_pytorch_model.safetensors", "vae/config.json", "tokenizer/merges.txt"}) {
    const ModelFolder folder;
    folder.remove(("stable-diffusion/" + std::string(file)).c_str());
    const Models models(folder.path());
    EXPECT_FALSE(models.findings()[0].usable) << file;
    EXPECT_FALSE(models.no_sd().empty()) << file;
    if (models.no_sd().find("libtorch") == std::string::npos) {
      EXPECT_NE(models.findings()[0].message.find(fs::path(file).filename().stem().string()), std::string::npos)
          << models.findings()[0].message;
    }
  }
}

}  // namespace
}  // namespace server::models
