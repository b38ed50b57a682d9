// Captures of a scene: cameras, photographs, sparse points.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/memory_budget.h"
#include "engine/core/result.h"
#include "engine/io/shot.h"
#include "engine/io/transforms_json.h"
#include "engine/scene/camera.h"
#include "engine/scene/image.h"

namespace engine::io {

/// A camera and, if there is one, its photo. The camera is a pinhole of the photo's size: that of the photo as
/// load_photo() gives it.
struct View {
  scene::Camera camera;         ///< camera.name: file name relative to the dataset's picture folder, "0001.jpg".
  std::filesystem::path photo;  ///< Empty if there is none.
  std::optional<Lens> lens;     ///< Lens of the photo as taken, if it has to be undistorted.
};

/// The cameras of a folder, with the sparse points if they were read.
struct Dataset {
  std::vector<View> views;     ///< Sorted by name. Names are unique.
  std::vector<Point> points;   ///< Points of the sparse reconstruction; may be empty.
  std::filesystem::path root;  ///< The folder.
  std::string kind;            ///< "colmap", "transforms" or "inria".
};

/// What read_dataset() reads, and where it looks.
struct DatasetOptions {
  bool points = true;             ///< Read the sparse points, too.
  std::string image_folder = {};  ///< Below the dataset, for COLMAP and INRIA; by default the first of images,
                                  ///< images_2, images_4 and images_8 that exists.
  TransformsWorld transforms_world = TransformsWorld::as_in_file;
  MemoryBudget* memory = nullptr;  ///< Lends what parsing JSON takes; null: nobody counts it.
};

/// Reads the cameras of a folder; photos are only looked for and measured. Recognised, in this order:
///   COLMAP      cameras and images, .bin or .txt, in sparse/0, sparse or the folder itself; points3D.bin, .txt or .ply
///   transforms  transforms.json or transforms_train.json; no points
///   INRIA       cameras.json of a model directory; input.ply
///   COLMAP      in colmap/sparse/0
/// or the .json file itself. The world is that of the files: nothing is re-oriented (but see transforms_world).
///
/// Photos. If the picture folder exists (for transforms: if any of its pictures does), every view must have its photo;
/// otherwise no view has one. A name without a known extension may lack it. A photo that is a scaled copy of what its
/// lens was calibrated for scales the camera. EXIF orientation is ignored, as by the programs that calibrate. A name
/// that leads out of the folder (absolute, or with "..") is refused; symbolic links are followed.
///   errors  not_found: nothing recognised (the message lists what was looked for), or a missing photo, by name;
///           corrupt_data, unsupported: those of the parsers; two views of one name; a photo of another shape;
///           invalid_argument: a camera with impossible numbers, "images.bin:image[17].fx";
///           unprocessable: no views
[[nodiscard]] Result<Dataset> read_dataset(const std::filesystem::path& folder, const DatasetOptions& options = {});

/// Those of all views, in order.
[[nodiscard]] std::vector<scene::Camera> cameras_of(const Dataset& dataset);

/// What load_photo() takes, bytes. Bringing what it gives to a smaller size, and encoding that, takes no more.
[[nodiscard]] std::uint64_t photo_memory(const View& view);

/// The view's photo, undistorted: camera.width x camera.height, 3 channels. Reads the file each time it is called.
///   errors  not_found: the view has no photo; those of read_image(); corrupt_data: it changed its size meanwhile
[[nodiscard]] Result<scene::Image> load_photo(const View& view);

}  // namespace engine::io
