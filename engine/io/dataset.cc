#include "engine/io/dataset.h"

#include <algorithm>
#include <cstdint>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "engine/io/cameras_json.h"
#include "engine/io/colmap.h"
#include "engine/io/image_file.h"
#include "engine/io/json_fields.h"
#include "engine/io/ply_points.h"
#include "engine/io/read_bytes.h"

namespace engine::io {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t max_model_bytes = std::uint64_t{4} << 30;   // images.bin holds every 2D point of the capture
constexpr std::uint64_t max_json_bytes = std::uint64_t{256} << 20;  // a tree of JSON takes ten times that in memory

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}
bool is_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

/// Where the photos are, and what it means if there are none.
struct PhotoFolder {
  fs::path path;
  bool expected = false;  ///< A photo that is missing is an error even if all are.
};

/// A name as it may stand in the file: relative, and within its folder. Kept in normal form ("./a//b" is "a/b").
Result<std::string> checked_name(const Shot& shot) {
  const auto bad = [&](const std::string& what) { return fail(ErrorCode::corrupt_data, what, shot.where); };
  if (std::ranges::any_of(shot.name, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }))
    return bad("the photo's name contains a control character");
  const fs::path name = fs::path(shot.name).lexically_normal();
  if (shot.name.empty() || !name.has_filename() || name == ".") return bad("expected the file name of a photo");
  if (name.is_absolute() || *name.begin() == "..")
    return bad("the photo " + shot.name + " lies outside the dataset's folder");
  return name.generic_string();
}

/// `name` below `folder`, or with an extension where it lacks one; empty if there is no such file.
std::string existing_photo(const fs::path& folder, const std::string& name) {
  for (const char* extension : {"", ".png", ".jpg", ".jpeg", ".JPG", ".PNG"})
    if (is_file(folder / (name + extension))) return name + extension;
  return {};
}

/// Puts the entry's address in front of the field that an error names.
tl::unexpected<Error> within(const std::string& where, Error error) {
  error.where = where + (error.where.empty() ? "" : ".") + error.where;
  return tl::make_unexpected(std::move(error));
}

Result<View> to_view(const Shot& shot, const std::string& name, const fs::path& photo) {
  Lens lens = shot.lens;
  View view;
  view.photo = photo;
  // Before the photo: resizing divides by the lens's size.
  auto camera = undistorted_camera(lens);
  if (!camera) return within(shot.where, camera.error());
  if (!photo.empty()) {
    const auto size = picture_size(photo);
    if (!size) return propagate(size);
    if (!same_shape(lens, size->width, size->height))
      return fail(ErrorCode::corrupt_data,
                  "the photo " + name + " has " + std::to_string(size->width) + "x" + std::to_string(size->height) +
                      " pixels, its camera was calibrated for " + std::to_string(lens.width) + "x" +
                      std::to_string(lens.height),
                  shot.where);
    if (size->width != lens.width || size->height != lens.height) {
      lens = resized(lens, size->width, size->height);
      camera = undistorted_camera(lens);
      if (!camera) return within(shot.where, camera.error());
    }
  }
  view.camera = *camera;
  view.camera.name = name;
  view.camera.rotation = shot.rotation;
  view.camera.translation = shot.translation;
  if (auto valid = validate(view.camera); !valid) return within(shot.where, valid.error());
  if (!lens.is_pinhole()) view.lens = lens;
  return view;
}

Result<std::vector<View>> to_views(const std::vector<Shot>& shots, const PhotoFolder& folder) {
  if (shots.empty()) return fail(ErrorCode::unprocessable, "the dataset has no views");
  struct Found {
    const Shot* shot;
    std::string name, file;  ///< Relative; `file` is empty if there is no photo.
  };
  std::vector<Found> found;
  for (const Shot& shot : shots) {
    auto name = checked_name(shot);
    if (!name) return propagate(name);
    auto file = folder.path.empty() ? std::string() : existing_photo(folder.path, *name);
    found.push_back({&shot, std::move(*name), std::move(file)});
  }
  std::ranges::stable_sort(found, {}, &Found::name);
  const auto twice = std::ranges::adjacent_find(found, {}, &Found::name);
  if (twice != found.end())
    return fail(ErrorCode::corrupt_data, "two views are called " + twice->name, std::next(twice)->shot->where);

  const bool with_photos =
      folder.expected || std::ranges::any_of(found, [](const Found& view) { return !view.file.empty(); });
  std::vector<View> views;
  for (const Found& view : found) {
    if (with_photos && view.file.empty())
      return fail(ErrorCode::not_found,
                  "the photo " + view.name + " is missing from " + folder.path.filename().string() + "/: add it",
                  view.shot->where);
    auto made = to_view(*view.shot, view.file.empty() ? view.name : view.file,
                        view.file.empty() ? fs::path() : folder.path / view.file);
    if (!made) return propagate(made);
    views.push_back(std::move(*made));
  }
  return views;
}

PhotoFolder image_folder(const fs::path& root, const DatasetOptions& options) {
  if (!options.image_folder.empty()) return {root / options.image_folder, true};
  for (const char* name : {"images", "images_2", "images_4", "images_8"})
    if (is_folder(root / name)) return {root / name, true};
  return {};
}

std::optional<ColmapEncoding> colmap_encoding(const fs::path& model) {
  if (is_file(model / "cameras.bin") && is_file(model / "images.bin")) return ColmapEncoding::binary;
  if (is_file(model / "cameras.txt") && is_file(model / "images.txt")) return ColmapEncoding::text;
  return std::nullopt;
}

Result<std::vector<Point>> read_colmap_points(const fs::path& model, ColmapEncoding encoding) {
  const std::string file = encoding == ColmapEncoding::binary ? "points3D.bin" : "points3D.txt";
  if (is_file(model / file)) {
    const auto bytes = read_bytes(model / file, max_model_bytes);
    if (!bytes) return propagate(bytes);
    return parse_colmap_points(*bytes, encoding, file);
  }
  if (is_file(model / "points3D.ply")) return read_ply_points(model / "points3D.ply");
  return std::vector<Point>();
}

Result<Dataset> read_colmap(const fs::path& root, const fs::path& model, ColmapEncoding encoding,
                            const DatasetOptions& options) {
  const std::string extension = encoding == ColmapEncoding::binary ? ".bin" : ".txt";
  const auto camera_bytes = read_bytes(model / ("cameras" + extension), max_model_bytes);
  if (!camera_bytes) return propagate(camera_bytes);
  const auto cameras = parse_colmap_cameras(*camera_bytes, encoding, "cameras" + extension);
  if (!cameras) return propagate(cameras);
  const auto image_bytes = read_bytes(model / ("images" + extension), max_model_bytes);
  if (!image_bytes) return propagate(image_bytes);
  const auto shots = parse_colmap_images(*image_bytes, encoding, "images" + extension, *cameras);
  if (!shots) return propagate(shots);

  // Someone may point at the model itself, sparse or sparse/0, with the photos beside `sparse`.
  fs::path capture = root;
  if (model == root && root.filename() == "sparse") capture = root.parent_path();
  if (model == root && root.parent_path().filename() == "sparse") capture = root.parent_path().parent_path();
  PhotoFolder folder = image_folder(root, options);
  if (folder.path.empty()) folder = image_folder(capture, options);
  auto views = to_views(*shots, folder);
  if (!views) return propagate(views);
  Dataset dataset{.views = std::move(*views), .points = {}, .root = root, .kind = "colmap"};
  if (options.points) {
    auto points = read_colmap_points(model, encoding);
    if (!points) return propagate(points);
    dataset.points = std::move(*points);
  }
  return dataset;
}

Result<Dataset> read_transforms(const fs::path& file, const DatasetOptions& options) {
  const fs::path root = file.parent_path();
  const std::string name = file.filename().string();
  const auto bytes = read_bytes(file, max_json_bytes);
  if (!bytes) return propagate(bytes);
  const auto size_of = [&](const std::string& file_path) -> Result<PictureSize> {
    Shot shot;
    shot.name = file_path, shot.where = name + ":frames";
    const auto checked = checked_name(shot);
    if (!checked) return propagate(checked);
    const auto photo = existing_photo(root, *checked);
    if (photo.empty())
      return fail(ErrorCode::not_found,
                  "the photo " + *checked + " is missing, and the file gives no w and h to do without it", name);
    return picture_size(root / photo);
  };
  const auto memory = take_from(options.memory, json_tree_bytes(*bytes), name);
  if (!memory) return propagate(memory);
  auto capture = parse_transforms_json(*bytes, name, options.transforms_world, size_of);
  if (!capture) return propagate(capture);
  auto views = to_views(*capture, {root, false});
  if (!views) return propagate(views);
  return Dataset{.views = std::move(*views), .points = {}, .root = root, .kind = "transforms"};
}

Result<Dataset> read_inria(const fs::path& file, const DatasetOptions& options) {
  const fs::path root = file.parent_path();
  const auto bytes = read_bytes(file, max_json_bytes);
  if (!bytes) return propagate(bytes);
  const auto memory = take_from(options.memory, json_tree_bytes(*bytes), file.filename().string());
  if (!memory) return propagate(memory);
  const auto shots = parse_cameras_json(*bytes, file.filename().string());
  if (!shots) return propagate(shots);
  auto views = to_views(*shots, image_folder(root, options));
  if (!views) return propagate(views);
  Dataset dataset{.views = std::move(*views), .points = {}, .root = root, .kind = "inria"};
  if (options.points && is_file(root / "input.ply")) {
    auto points = read_ply_points(root / "input.ply");
    if (!points) return propagate(points);
    dataset.points = std::move(*points);
  }
  return dataset;
}

Result<Dataset> read_recognised(const fs::path& folder, const DatasetOptions& options) {
  if (is_file(folder) && folder.extension() == ".json")
    return folder.filename() == "cameras.json" ? read_inria(folder, options) : read_transforms(folder, options);
  if (!is_folder(folder))
    return fail(ErrorCode::not_found, "there is no folder " + folder.string() + " with a dataset", folder.string());
  for (const fs::path& model : {folder / "sparse" / "0", folder / "sparse", folder})
    if (const auto encoding = colmap_encoding(model)) return read_colmap(folder, model, *encoding, options);
  for (const char* name : {"transforms.json", "transforms_train.json"})
    if (is_file(folder / name)) return read_transforms(folder / name, options);
  if (is_file(folder / "cameras.json")) return read_inria(folder / "cameras.json", options);
  if (const auto model = folder / "colmap" / "sparse" / "0"; const auto encoding = colmap_encoding(model))
    return read_colmap(folder, model, *encoding, options);
  return fail(ErrorCode::not_found,
              "no dataset recognised: looked for cameras.bin and images.bin (or .txt) in sparse/0, sparse, the folder "
              "itself and colmap/sparse/0, for transforms.json, transforms_train.json and cameras.json",
              folder.filename().string());
}

}  // namespace

Result<Dataset> read_dataset(const fs::path& folder, const DatasetOptions& options) {
  try {
    const fs::path normal = folder.lexically_normal();
    return read_recognised(normal.has_filename() ? normal : normal.parent_path(), options);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large, "the dataset does not fit into the memory of this machine");
  }
}

std::vector<scene::Camera> cameras_of(const Dataset& dataset) {
  std::vector<scene::Camera> cameras;
  for (const View& view : dataset.views) cameras.push_back(view.camera);
  return cameras;
}

namespace {

/// Of the photo as it is stored.
std::uint64_t photo_pixels(const View& view) {
  return view.lens ? std::uint64_t(view.lens->width) * std::uint64_t(view.lens->height)
                   : std::uint64_t(view.camera.width) * std::uint64_t(view.camera.height);
}

}  // namespace

std::uint64_t photo_memory(const View& view) {
  std::error_code unknown;
  const auto file_bytes = fs::file_size(view.photo, unknown);
  // Interleaved and by channel, four floats each; what the library unpacks from; and the photo without its distortion.
  constexpr std::uint64_t pixel_bytes = 16 + 16 + 8 + 12;
  return (unknown ? 0 : std::uint64_t{file_bytes}) + pixel_bytes * photo_pixels(view);
}

Result<scene::Image> load_photo(const View& view) {
  if (view.photo.empty())
    return fail(ErrorCode::not_found, "view " + view.camera.name + " has no photo", view.camera.name);
  const std::uint64_t pixels = photo_pixels(view);
  // About the size that was counted, with up to 8 channels, or none: it may have been exchanged meanwhile.
  auto photo = read_image(view.photo, {.max_pixels = 2 * pixels});
  if (!photo && photo.error().code != ErrorCode::too_large) return photo;
  const int width = view.lens ? view.lens->width : view.camera.width;
  const int height = view.lens ? view.lens->height : view.camera.height;
  if (!photo || photo->width != width || photo->height != height)
    return fail(ErrorCode::corrupt_data,
                "the photo of view " + view.camera.name + " has changed its size since the dataset was read",
                view.camera.name);
  return view.lens ? undistort(*photo, *view.lens, view.camera) : photo;
}

}  // namespace engine::io
