#include "server/models/models.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <map>
#include <system_error>
#include <utility>

#include "engine/weights/adapter_file.h"
#include "engine/weights/checkpoint.h"
#include "engine/weights/vocabulary.h"
#include "server/models/lpips_folder.h"

namespace server::models {
namespace {

namespace fs = std::filesystem;
namespace weights = engine::weights;

constexpr const char* without_libtorch =
    "this build has no libtorch: install libtorch-dev, libopenblas0-pthread and libutf8proc-dev and build again "
    "(docs/stable-diffusion.md)";
constexpr const char* advice = "; \"splatdrag models\" says which files go where";

/// In "FILE:PLACE" of an error, so that who installs models finds it.
std::string described(const engine::Error& error) {
  return error.where.empty() ? error.message : error.where + ": " + error.message;
}

bool is_there(const fs::path& path) {
  std::error_code unreachable;  // then it cannot be used either
  return fs::exists(path, unreachable);
}

Finding look_at_checkpoint(const fs::path& folder, const fs::path& checkpoint) {
  if (checkpoint.empty())
    return {"sd", false,
            "no checkpoint: put a folder of Stable Diffusion 1.x or 2.x-base as diffusers writes it at " +
                (folder / "stable-diffusion").string() + ", or one file at " +
                (folder / "stable-diffusion.safetensors").string() + " with its tokenizer at " +
                (folder / "tokenizer").string(),
            true};
  const auto opened = weights::Checkpoint::open(checkpoint);
  if (!opened) return {"sd", false, checkpoint.string() + ": " + described(opened.error())};
  if (const auto whole = opened->check(); !whole)
    return {"sd", false, checkpoint.string() + ": " + described(whole.error())};
  for (const char* file : {"vocab.json", "merges.txt"})
    if (!is_there(opened->tokenizer_folder() / file))
      return {"sd", false, "no tokenizer: " + (opened->tokenizer_folder() / file).string() + " is missing"};
  const auto vocabulary = weights::read_vocabulary(opened->tokenizer_folder(), opened->is_open_clip(),
                                                   opened->configs().text_encoder.vocabulary);
  if (!vocabulary) return {"sd", false, opened->tokenizer_folder().string() + ": " + described(vocabulary.error())};
  return {"sd", true, checkpoint.string()};
}

Finding look_at_lpips(const fs::path& folder) {
  for (const auto& [name, what] :
       {std::pair{vgg16_file, "VGG16 of torchvision"}, {lpips_file, "LPIPS's own weights"}}) {
    const fs::path file = folder / "lpips" / name;
    if (!is_there(file))
      return {"lpips", false, std::string("no ") + what + ": " + file.string() + " is missing",
              !is_there(folder / "lpips" / vgg16_file) && !is_there(folder / "lpips" / lpips_file)};
  }
  if (const auto opened = open_lpips(folder); !opened)
    return {"lpips", false, (folder / "lpips").string() + ": " + described(opened.error())};
  return {"lpips", true, (folder / "lpips").string()};
}

/// Requests and answers are in UTF-8, and people type names.
bool is_plain(const std::string& name) {
  return std::ranges::all_of(name, [](char letter) { return letter >= ' ' && letter <= '~'; });
}

/// What lies below the model folder for adapters.
struct AdapterFiles {
  std::map<std::string, std::vector<fs::path>> by_name;  ///< Those that can be asked for.
  std::vector<Finding> useless;                          ///< What else is there, but for hidden files.
};

AdapterFiles adapter_files(const fs::path& folder) {
  AdapterFiles files;
  const fs::path adapters = folder / "lora";
  const auto unnamed = [&](const std::string& problem) {
    files.useless.push_back({"lora ?", false, adapters.string() + ": " + problem});
  };
  std::error_code unreadable;
  fs::directory_iterator entry(adapters, unreadable);
  for (; !unreadable && entry != fs::directory_iterator(); entry.increment(unreadable)) {
    const fs::path& path = entry->path();
    const bool is_file = path.extension() == ".safetensors";
    const std::string name = (is_file ? path.stem() : path.filename()).string();
    if (name.starts_with('.')) continue;
    if (!is_plain(name)) {
      unnamed("a name there has other characters than ASCII's printable ones: rename it");
      continue;
    }
    // As diffusers and peft publish them; a folder that has both is none to choose for anybody.
    std::vector<fs::path> found;
    if (is_file) found.push_back(path);
    for (const char* published : {"pytorch_lora_weights.safetensors", "adapter_model.safetensors"})
      if (is_there(path / published)) found.push_back(path / published);
    if (found.empty())
      files.useless.push_back({"lora " + name, false,
                               path.string() + ": not a .safetensors file, nor a folder with "
                                               "pytorch_lora_weights.safetensors or adapter_model.safetensors"});
    else
      files.by_name[name].insert(files.by_name[name].end(), found.begin(), found.end());
  }
  if (unreadable && unreadable != std::errc::no_such_file_or_directory)
    unnamed("it cannot be read: " + unreadable.message());
  return files;
}

///   bytes  set to what it takes in memory if it can be used
Finding look_at_adapter(const std::string& name, const std::vector<fs::path>& files, const weights::Configs& configs,
                        std::uint64_t& bytes) {
  const std::string path = files.front().string();
  if (files.size() > 1)
    return {"lora " + name, false, path + ": two files are of this name: it would be for chance to choose"};
  const auto adapter = weights::read_adapter(files.front(), configs);
  if (!adapter) return {"lora " + name, false, path + ": " + described(adapter.error())};
  bytes = adapter->bytes();
  return {"lora " + name, true, path};
}

}  // namespace

Models::Models(fs::path folder, int threads)
    : folder_(std::move(folder)), threads_(threads), loaded_(nothing_loaded()) {
  if (folder_.empty()) {
    for (const char* name : {"sd", "lpips"})
      findings_.push_back({name, false, "no folder of models is named: give --model-dir", true});
  } else {
    for (const char* name : {"stable-diffusion", "stable-diffusion.safetensors"})
      if (checkpoint_.empty() && is_there(folder_ / name)) checkpoint_ = folder_ / name;
    findings_ = {look_at_checkpoint(folder_, checkpoint_), look_at_lpips(folder_)};
  }
  if (findings_[0].usable) look_at_adapters();
  const auto why_not = [&](Finding& finding, const std::string& what) -> std::string {
    if (!has_libtorch()) {
      finding = {finding.name, false, without_libtorch + std::string(finding.usable ? "; its files are there" : ""),
                 finding.absent};
      return without_libtorch;
    }
    if (finding.usable) return {};
    return folder_.empty() ? "no models are installed: the program is started without --model-dir" + std::string(advice)
                           : what + advice;
  };
  no_sd_ = why_not(findings_[0], "no checkpoint of Stable Diffusion that can be used is installed");
  no_lpips_ = why_not(findings_[1], "the networks of LPIPS are not installed");
}

void Models::look_at_adapters() {
  const auto checkpoint = weights::Checkpoint::open(checkpoint_);
  if (!checkpoint) return;  // it was there a moment ago: whoever uses it is told
  AdapterFiles files = adapter_files(folder_);
  for (const auto& [name, paths] : files.by_name) {
    std::uint64_t bytes = 0;
    Finding finding = look_at_adapter(name, paths, checkpoint->configs(), bytes);
    if (finding.usable) loras_.emplace(name, Lora{paths.front(), bytes});
    if (finding.usable && !has_libtorch()) finding.usable = false, finding.message = without_libtorch;
    findings_.push_back(std::move(finding));
  }
  std::ranges::move(files.useless, std::back_inserter(findings_));
}

std::vector<std::string> Models::loras() const {
  std::vector<std::string> names;
  if (no_sd_.empty())
    for (const auto& [name, lora] : loras_) names.push_back(name);
  return names;
}

}  // namespace server::models
