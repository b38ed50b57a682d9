// Scenes, datasets and zip files for the tests of the scene store.
#pragma once

#include <gtest/gtest.h>
#include <zip.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/scene_file.h"
#include "engine/scene/overlay.h"
#include "server/scenes/scene_store.h"
#include "tests/engine/scene/random_cloud.h"
#include "tests/support/data.h"

namespace server::scenes {

namespace fs = std::filesystem;
using engine::ErrorCode;
using engine::scene::GaussianCloud;
using engine::scene::Overlay;

/// A store in a folder of its own, and beside it a scene root and room for files.
struct StoreFixture : testing::Test {
  support::TempDir temp;
  StoreOptions options;
  std::unique_ptr<SceneStore> store;
  Time now{std::chrono::seconds(1'700'000'000)};

  StoreFixture() {
    options.folder = temp.path() / "scenes";
    options.scene_root = temp.path() / "root";
    options.clock = [this] { return now; };
    fs::create_directories(options.scene_root);
    open();
  }
  void open() {
    store.reset();
    auto opened = SceneStore::open(options);
    if (!opened) throw std::runtime_error(opened.error().message);
    store = std::move(*opened);
  }

  static engine::io::SceneFile scene_file(const GaussianCloud& cloud) {
    return {cloud, engine::io::inria_layout(cloud.sh_degree)};
  }
  static void write(const fs::path& file, const GaussianCloud& cloud,
                    engine::io::SceneFormat format = engine::io::SceneFormat::ply) {
    if (const auto written = engine::io::write_scene(file, scene_file(cloud), format); !written)
      throw std::runtime_error(written.error().message);
  }
  /// Adds a scene of random Gaussians; its id.
  std::string add(std::size_t gaussians = 50, std::uint64_t seed = 1, int degree = 1) {
    write(temp.path() / "up.ply", engine::scene::random_cloud(gaussians, degree, seed));
    const auto added = store->add_upload(temp.path() / "up.ply", "chair.ply", "");
    if (!added) throw std::runtime_error(added.error().message);
    return added->id;
  }
  GaussianCloud cloud_of(const std::string& id, const std::string& version) {
    const auto loaded = store->load(id, version);
    if (!loaded) throw std::runtime_error(loaded.error().message);
    return engine::scene::flatten(loaded->cloud);
  }
};

/// Takes row 0 away, lifts row 1, adds a copy of row 2.
inline Overlay small_edit(const GaussianCloud& cloud, float lift = 1) {
  Overlay overlay;
  overlay.removed = {0};
  overlay.changed = {1};
  overlay.rows.sh_degree = cloud.sh_degree;
  overlay.rows.extra_stride = cloud.extra_stride;
  const std::vector<std::uint32_t> rows{1, 2};
  engine::scene::append_rows(overlay.rows, cloud, rows);
  overlay.rows.mean.y[0] += lift;
  return overlay;
}

/// A version as an edit makes it; its number.
inline Result<int> add_version(SceneStore& store, const std::string& id, int parent, const std::string& edit,
                               const Overlay& overlay) {
  static std::atomic<std::int64_t> attempts = 0;
  const auto made = store.make_version(id, parent, edit, ++attempts, overlay);
  if (!made) return engine::propagate(made);
  return store.take_in(id, *made);
}

/// What stands under which name in a zip file.
struct Zipped {
  std::string name, content;
  bool link = false, encrypted = false;
};

inline void write_zip(const fs::path& file, const std::vector<Zipped>& entries) {
  int error = 0;
  zip_t* const archive = zip_open(file.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &error);
  if (archive == nullptr) throw std::runtime_error("cannot make the zip file");
  for (const Zipped& entry : entries) {
    zip_source_t* const source = zip_source_buffer(archive, entry.content.data(), entry.content.size(), 0);
    const zip_int64_t index = zip_file_add(archive, entry.name.c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) throw std::runtime_error("cannot add " + entry.name);
    if (entry.link) zip_file_set_external_attributes(archive, zip_uint64_t(index), 0, ZIP_OPSYS_UNIX, 0120777u << 16);
    if (entry.encrypted) zip_file_set_encryption(archive, zip_uint64_t(index), ZIP_EM_AES_256, "secret");
  }
  if (zip_close(archive) != 0) throw std::runtime_error("cannot close the zip file");
}

/// Two cameras without photos, as nerfstudio writes them.
inline std::string transforms_json() {
  const std::string pose = R"([[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]])";
  return R"({"fl_x": 50, "fl_y": 50, "cx": 32, "cy": 24, "w": 64, "h": 48, "frames": [)"
         R"({"file_path": "images/a.png", "transform_matrix": )" +
         pose + R"(}, {"file_path": "images/b.png", "transform_matrix": )" + pose + "}]}";
}

}  // namespace server::scenes
