#include "server/models/models.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "engine/params/params.h"
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
  EXPECT_EQ(none.cost({}).training_step, 0);
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
  const RepainterCost usual = models.cost(params);
  EXPECT_GT(usual.training_step, 0);
  EXPECT_GT(usual.bytes, std::uint64_t{1} << 20);
  params.sampling_steps = 40;
  EXPECT_NEAR(models.cost(params).full_strength, 2 * usual.full_strength, 1e-9);
  params.sampling_steps = 501;
  EXPECT_EQ(models.repainter(params, {}).error().where, "params.sampling_steps");
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
