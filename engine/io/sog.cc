#include "engine/io/sog.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/io/checks.h"
#include "engine/io/input_file.h"
#include "engine/io/json_fields.h"
#include "engine/io/palette.h"
#include "engine/io/quantised.h"
#include "engine/io/webp.h"
#include "engine/io/zip_archive.h"

namespace engine::io {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t rows_per_task = 4096;              // of a parallel task: a choice
constexpr std::uint64_t max_meta_bytes = 256u << 10;     // of a meta.json: a choice; with codebooks it has 15 KB
constexpr std::uint64_t max_lod_meta_bytes = 64u << 20;  // of a lod-meta.json: 100 bytes per leaf and level
constexpr std::size_t max_palette = 65536, palette_columns = 64;  // of the format
constexpr std::size_t max_lod_files = 10'000;                     // of a streamed scene: a choice
constexpr std::size_t max_level_files = 1'000;  // of one of its levels: a choice; half a million rows in each are usual
constexpr int max_lod_depth = 64;               // of its tree: a choice; an octree of that depth has no end
constexpr int rotation_mode = 252;              // the alpha of a rotation is this and the largest's index
constexpr const char* meta_name = "meta.json";
constexpr const char* lod_meta_name = "lod-meta.json";

/// Files of a scene, by names relative to its folder that have been checked: from a zip file or a folder.
struct Files {
  std::string file;  ///< For error addresses.
  std::function<Result<UnpackedFile>(const std::string& name, std::uint64_t most)> read_file;

  /// One that the scene names and that is not there is the scene's fault: to whoever sent it, it was found.
  [[nodiscard]] Result<UnpackedFile> read(const std::string& name, std::uint64_t most) const {
    auto found = read_file(name, most);
    if (!found && found.error().code == ErrorCode::not_found)
      return fail(ErrorCode::corrupt_data, "the scene names a file that is missing: copy or download it again, whole",
                  found.error().where);
    return found;
  }
};

/// A relative name without a way out, in its shortest form; nothing for any other.
std::optional<std::string> safe_name(const std::string& folder, const std::string& name) {
  const bool control = std::ranges::any_of(name, [](unsigned char c) { return c < 0x20 || c == 0x7f; });
  if (name.empty() || name.size() > 1000 || control || name.front() == '/' || name.find('\\') != std::string::npos ||
      name.find(':') != std::string::npos)
    return std::nullopt;
  for (const fs::path& part : fs::path(name))
    if (part == "..") return std::nullopt;
  return (fs::path(folder) / fs::path(name)).lexically_normal().generic_string();
}

std::string parent_of(const std::string& name) { return fs::path(name).parent_path().generic_string(); }

/// What of meta.json is believed once it has been read.
struct Meta {
  int version = 0;
  std::uint64_t count = 0;
  bool antialiased = false;
  int sh_degree = 0;          ///< Version 2; version 1 says it by the width of its palette.
  std::uint64_t palette = 0;  ///< Version 2; version 1 says it by its height.
  bool has_sh = false;
  std::array<double, 3> mean_low{}, mean_high{};
  std::array<double, 256> scales{}, colours{}, sh{};                             ///< Version 2: codebooks.
  std::array<double, 4> scale_low{}, scale_high{}, colour_low{}, colour_high{};  ///< Version 1: ranges.
  double sh_low = 0, sh_high = 0;
  std::vector<std::string> means, scales_files, quats, sh0, shn;  ///< Names, checked and relative to the root.
};

std::vector<std::string> file_names(const JsonFields& part, std::size_t count, const std::string& folder) {
  const JsonFields files = part.at("files");
  std::vector<std::string> names;
  if (files.size() != count) files.fail_here("expected the names of " + std::to_string(count) + " pictures");
  for (std::size_t i = 0; i < std::min(count, files.size()); ++i) {
    const auto name = safe_name(folder, files.at(i).string());
    if (!name)
      files.at(i).fail_here("the name of a file in the scene's own folder was expected, without a way out of it");
    names.push_back(name.value_or(""));
  }
  return names;
}

std::uint64_t whole(const JsonFields& field, std::uint64_t most) {
  const double value = field.number();
  if (value >= 0 && value <= double(most) && value == std::floor(value)) return std::uint64_t(value);
  field.fail_here("expected a whole number from 0 to " + std::to_string(most));
  return 0;
}

/// A range or a codebook. Numbers beyond what a float holds are no numbers of a scene.
void bounded_numbers(const JsonFields& field, double* out, std::size_t count) {
  field.numbers(out, count);
  for (std::size_t i = 0; i < count; ++i)
    if (!(std::abs(out[i]) <= 1e30)) field.fail_here("a number is too large");
}

void codebook(const JsonFields& part, std::array<double, 256>& out) {
  const JsonFields book = part.at("codebook");
  // Some writers leave out what no picture uses; no index leads there then.
  const std::size_t count = book.size();
  if (count == 0 || count > out.size()) return book.fail_here("expected up to 256 numbers");
  bounded_numbers(book, out.data(), count);
  std::fill(out.begin() + std::ptrdiff_t(count), out.end(), out[count - 1]);
}

void range(const JsonFields& part, double* low, double* high, std::size_t count) {
  bounded_numbers(part.at("mins"), low, count);
  bounded_numbers(part.at("maxs"), high, count);
}

Meta parse_meta(const JsonFields& root, const std::string& folder) {
  Meta meta;
  constexpr std::uint64_t most = std::uint64_t{1} << 32;
  meta.version = root.has("version") ? int(whole(root.at("version"), 1000)) : 1;
  if (meta.version != 1 && meta.version != 2) return meta;  // whose fields are called otherwise, perhaps
  const JsonFields means = root.at("means"), scales = root.at("scales"), sh0 = root.at("sh0");
  range(means, meta.mean_low.data(), meta.mean_high.data(), 3);
  for (std::size_t c = 0; c < 3; ++c)
    if (std::max(std::abs(meta.mean_low[c]), std::abs(meta.mean_high[c])) > 80)
      means.fail_here("positions, whose logarithms these are, beyond what a float holds");
  meta.means = file_names(means, 2, folder);
  meta.scales_files = file_names(scales, 1, folder);
  meta.quats = file_names(root.at("quats"), 1, folder);
  meta.sh0 = file_names(sh0, 1, folder);
  meta.has_sh = root.has_value("shN");
  if (meta.has_sh) meta.shn = file_names(root.at("shN"), 2, folder);
  if (meta.version == 2) {
    meta.count = whole(root.at("count"), most);
    if (root.has("antialias")) meta.antialiased = root.at("antialias").boolean();
    codebook(scales, meta.scales), codebook(sh0, meta.colours);
    if (meta.has_sh) {
      const JsonFields shn = root.at("shN");
      meta.sh_degree = int(whole(shn.at("bands"), 3));
      meta.palette = whole(shn.at("count"), max_palette);
      codebook(shn, meta.sh);
      if (meta.sh_degree == 0 || meta.palette == 0) shn.fail_here("expected 1 to 3 bands, and 1 to 65536 entries");
    }
  } else {
    const JsonFields shape = means.at("shape");
    meta.count = shape.size() > 0 ? whole(shape.at(std::size_t{0}), most) : 0;
    range(scales, meta.scale_low.data(), meta.scale_high.data(), 3);
    range(sh0, meta.colour_low.data(), meta.colour_high.data(), 4);
    if (meta.has_sh) {
      // A number for all, in an array or not.
      const auto one = [&](const JsonFields& field) {
        return (field.is_array() ? field.at(std::size_t{0}) : field).number();
      };
      meta.sh_low = one(root.at("shN").at("mins")), meta.sh_high = one(root.at("shN").at("maxs"));
    }
  }
  return meta;
}

class Sog {
 public:
  Sog(Files files, const ReadOptions& options) : files_(std::move(files)), options_(options) {}

  Result<DecodedScene> read(const std::string& root) {
    const bool streamed = fs::path(root).filename() == lod_meta_name;
    DecodedScene scene;
    auto cloud = streamed ? read_streamed(root, scene.origin) : read_one(root, scene.origin);
    if (!cloud) return propagate(cloud);
    scene.cloud = std::move(*cloud);
    scene.origin.format = SceneFormat::sog;
    scene.origin.packing = streamed ? "WebP, palettes, levels of detail" : "WebP, palettes";
    if (auto finite = check_finite(scene.cloud, files_.file); !finite) return propagate(finite);
    return scene;
  }

  /// Gaussians of a scene and their SH degree, from its text alone.
  Result<std::pair<std::uint64_t, int>> size(const std::string& root) {
    if (fs::path(root).filename() == lod_meta_name) {
      const auto plan = plan_of(root);
      if (!plan) return propagate(plan);
      return std::pair(plan->count, plan->sh_degree);
    }
    const auto meta = meta_of(root);
    if (!meta) return propagate(meta);
    // Version 1 names the degree by the width of its palette only.
    return std::pair(meta->count, meta->version == 2 ? meta->sh_degree : meta->has_sh ? scene::max_sh_degree : 0);
  }

 private:
  /// Rows of one of a streamed scene's files.
  struct Piece {
    std::size_t file = 0;
    std::uint64_t offset = 0, count = 0;
  };
  struct Plan {
    std::vector<std::string> names;  ///< Of the meta.json files.
    std::vector<Piece> pieces;
    std::map<std::size_t, Meta> metas;
    std::uint64_t count = 0;
    int sh_degree = 0;
    bool has_environment = false;
    int levels = 0;
  };

  [[nodiscard]] std::string where(const std::string& name) const { return files_.file + ":" + name; }

  /// A text as a tree, and the memory lent for it.
  struct Document {
    json tree;
    MemoryBudget::Share memory;
  };
  Result<Document> parsed(const std::string& name, std::uint64_t most) {
    const auto text = files_.read(name, most);
    if (!text) return propagate(text);
    auto lent = take_from(options_.memory, json_tree_bytes(text->bytes), where(name));
    if (!lent) return propagate(lent);
    auto tree = parse_json(text->bytes, where(name));
    if (!tree) return propagate(tree);
    return Document{std::move(*tree), std::move(*lent)};
  }

  Result<Meta> meta_of(const std::string& name) {
    const auto document = parsed(name, max_meta_bytes);
    if (!document) return propagate(document);
    std::optional<Error> error;
    Meta meta = parse_meta(JsonFields(document->tree, where(name) + ":", error), parent_of(name));
    if (error) return tl::make_unexpected(std::move(*error));
    if (meta.version != 1 && meta.version != 2)
      return fail(ErrorCode::unsupported, "SOG version " + std::to_string(meta.version) + "; 1 and 2 are known",
                  where(name) + ":version");
    return meta;
  }

  Result<BytePicture> picture(const std::string& name, std::uint64_t most_pixels) {
    // Noise in four channels takes 4 bytes per pixel and a little.
    const auto file = files_.read(name, 8 * most_pixels + (1u << 20));
    if (!file) return propagate(file);
    auto decoded = decode_webp(file->bytes, most_pixels, options_.memory, where(name));
    if (decoded && !decoded->exact) inexact_.push_back(name);
    return decoded;
  }

  /// A picture with a pixel for each Gaussian. Tools make them square, or sides of powers of two: up to four times
  /// that.
  Result<BytePicture> picture_of_rows(const std::string& name, const Meta& meta) {
    auto found = picture(name, 4 * meta.count + (1u << 16));
    if (found && found->pixels() < meta.count)
      return fail(ErrorCode::corrupt_data,
                  std::to_string(meta.count) + " Gaussians, but " + std::to_string(found->pixels()) + " pixels",
                  where(name));
    return found;
  }

  Result<scene::GaussianCloud> read_one(const std::string& name, SceneOrigin& origin) {
    const auto meta = meta_of(name);
    if (!meta) return propagate(meta);
    note(*meta, origin);
    auto cloud = decode(*meta);
    note_inexact(origin);
    return cloud;
  }

  static void note(const Meta& meta, SceneOrigin& origin) {
    origin.version = meta.version;
    origin.antialiased = meta.antialiased;
  }
  void note_inexact(SceneOrigin& origin) const {
    for (const std::string& name : inexact_)
      origin.left_out.push_back(name +
                                " was compressed with loss, which the format forbids: its numbers are not those "
                                "of the scene");
  }

  Result<scene::GaussianCloud> decode(const Meta& meta) {
    // Version 1 says its SH degree by the width of a picture: the header's worst case is asked for first.
    const int expected = meta.version == 2 ? meta.sh_degree : 0;
    if (auto checked = check_limits(meta.count, cloud_row_bytes(expected), options_, files_.file); !checked)
      return propagate(checked);
    std::optional<BytePicture> centroids;
    int degree = expected;
    if (meta.has_sh) {
      auto found = picture(meta.shn[0], palette_columns * 15 * (max_palette / palette_columns));
      if (!found) return propagate(found);
      centroids.emplace(std::move(*found));
      if (auto fits = check_palette(meta, *centroids, degree); !fits) return propagate(fits);
      if (auto checked = check_limits(meta.count, cloud_row_bytes(degree), options_, files_.file); !checked)
        return propagate(checked);
    }
    scene::GaussianCloud cloud;
    cloud.sh_degree = degree;
    // The first pictures are decoded before a cloud is allocated that no picture bears out.
    const auto low = picture_of_rows(meta.means[0], meta);
    if (!low) return propagate(low);
    const auto high = picture_of_rows(meta.means[1], meta);
    if (!high) return propagate(high);
    cloud.resize(meta.count);
    each_row(meta.count, [&](std::size_t i) {
      Vec3 mean;
      for (std::size_t c = 0; c < 3; ++c) {
        const double t = double(high->pixel(i)[c] << 8 | low->pixel(i)[c]) / 65535.0;
        const double n = meta.mean_low[c] + t * (meta.mean_high[c] - meta.mean_low[c]);
        mean[int(c)] = float(std::copysign(std::expm1(std::abs(n)), n));
      }
      cloud.mean.set(i, mean);
    });
    if (auto done = decode_scales(meta, cloud); !done) return propagate(done);
    if (auto done = decode_rotations(meta, cloud); !done) return propagate(done);
    if (auto done = decode_colours(meta, cloud); !done) return propagate(done);
    if (centroids)
      if (auto done = decode_sh(meta, *centroids, cloud); !done) return propagate(done);
    return cloud;
  }

  template <class Row>
  static void each_row(std::uint64_t count, Row&& row) {
    parallel_for(std::size_t(count), rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) row(i);
    });
  }

  Result<void> check_palette(const Meta& meta, const BytePicture& centroids, int& degree) const {
    for (degree = 1; degree <= scene::max_sh_degree; ++degree)
      if (centroids.width == palette_columns * (scene::sh_coefficients(degree) - 1)) break;
    if (degree > scene::max_sh_degree || (meta.version == 2 && degree != meta.sh_degree))
      return fail(ErrorCode::corrupt_data,
                  "a palette of SH degree 1, 2 or 3 is 192, 512 or 960 pixels wide; this one has " +
                      std::to_string(centroids.width) +
                      (meta.version == 2 ? ", for degree " + std::to_string(meta.sh_degree) : std::string()),
                  where(meta.shn[0]));
    if (meta.version == 2 && centroids.height * palette_columns < meta.palette)
      return fail(ErrorCode::corrupt_data,
                  "a palette of " + std::to_string(meta.palette) + " entries, but room for " +
                      std::to_string(centroids.height * palette_columns),
                  where(meta.shn[0]));
    return {};
  }

  Result<void> decode_scales(const Meta& meta, scene::GaussianCloud& cloud) {
    const auto in = picture_of_rows(meta.scales_files[0], meta);
    if (!in) return propagate(in);
    each_row(meta.count, [&](std::size_t i) {
      Vec3 scale;
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint8_t u = in->pixel(i)[c];
        scale[int(c)] =
            float(meta.version == 2 ? meta.scales[u]
                                    : meta.scale_low[c] + u / 255.0 * (meta.scale_high[c] - meta.scale_low[c]));
      }
      cloud.log_scale.set(i, scale);
    });
    return {};
  }

  Result<void> decode_rotations(const Meta& meta, scene::GaussianCloud& cloud) {
    const auto in = picture_of_rows(meta.quats[0], meta);
    if (!in) return propagate(in);
    for (std::size_t i = 0; i < meta.count; ++i)
      if (in->pixel(i)[3] < rotation_mode)
        return fail(ErrorCode::corrupt_data,
                    "the alpha of a rotation is 252 to 255, and says which component was the largest; found " +
                        std::to_string(in->pixel(i)[3]),
                    files_.file + ":vertex[" + std::to_string(i) + "].rot");
    each_row(meta.count, [&](std::size_t i) {
      const std::uint8_t* bytes = in->pixel(i);
      cloud.rotation.set(i, unpack_rotation({bytes[0], bytes[1], bytes[2], bytes[3]}));
    });
    return {};
  }

  Result<void> decode_colours(const Meta& meta, scene::GaussianCloud& cloud) {
    const auto in = picture_of_rows(meta.sh0[0], meta);
    if (!in) return propagate(in);
    const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
    const auto lerp = [&](std::size_t c, std::uint8_t u) {
      return float(meta.colour_low[c] + u / 255.0 * (meta.colour_high[c] - meta.colour_low[c]));
    };
    each_row(meta.count, [&](std::size_t i) {
      const std::uint8_t* bytes = in->pixel(i);
      for (std::size_t c = 0; c < 3; ++c)
        cloud.sh_row(i)[c * coefficients] = meta.version == 2 ? float(meta.colours[bytes[c]]) : lerp(c, bytes[c]);
      cloud.opacity_logit[i] = meta.version == 2 ? logit_of_byte(bytes[3]) : lerp(3, bytes[3]);
    });
    return {};
  }

  Result<void> decode_sh(const Meta& meta, const BytePicture& centroids, scene::GaussianCloud& cloud) {
    const auto labels = picture_of_rows(meta.shn[1], meta);
    if (!labels) return propagate(labels);
    const std::uint64_t entries = meta.version == 2 ? meta.palette : centroids.height * palette_columns;
    const auto label = [&](std::size_t i) { return std::size_t(labels->pixel(i)[0] | labels->pixel(i)[1] << 8); };
    for (std::size_t i = 0; i < meta.count; ++i)
      if (label(i) >= entries)
        return fail(ErrorCode::corrupt_data,
                    "entry " + std::to_string(label(i)) + " of a palette of " + std::to_string(entries),
                    files_.file + ":vertex[" + std::to_string(i) + "].f_rest");
    const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree), kept = coefficients - 1;
    each_row(meta.count, [&](std::size_t i) {
      const std::size_t entry = label(i);
      const std::size_t first = entry / palette_columns * centroids.width + entry % palette_columns * kept;
      for (std::size_t k = 0; k < kept; ++k)
        for (std::size_t c = 0; c < 3; ++c) {
          const std::uint8_t u = centroids.pixel(first + k)[c];
          cloud.sh_row(i)[c * coefficients + k + 1] =
              float(meta.version == 2 ? meta.sh[u] : meta.sh_low + u / 255.0 * (meta.sh_high - meta.sh_low));
        }
    });
    return {};
  }

  /// What a leaf gives for the level that is asked for, else for its nearest finer or coarser one.
  void add_piece(const JsonFields& lods, Plan& plan) const {
    const auto has = [&](int level) { return lods.has(std::to_string(level).c_str()); };
    int level = options_.level;
    while (level >= 0 && !has(level)) --level;
    if (level < 0)
      for (level = options_.level + 1; level < plan.levels && !has(level);) ++level;
    if (level >= plan.levels) return;
    const JsonFields leaf = lods.at(std::to_string(level).c_str());
    const Piece piece{std::size_t(whole(leaf.at("file"), 1u << 24)), whole(leaf.at("offset"), std::uint64_t{1} << 32),
                      whole(leaf.at("count"), std::uint64_t{1} << 32)};
    if (piece.file >= plan.names.size()) leaf.at("file").fail_here("there is no such file among filenames");
    plan.pieces.push_back(piece);
    plan.count += piece.count;
  }

  /// Reads what the files say that the plan's pieces are in: whether these are there, and of which degree.
  Result<void> find_files(const std::string& name, Plan& plan) {
    const std::uint64_t most_rows = 2 * std::min<std::uint64_t>(options_.max_gaussians, std::uint64_t{1} << 32);
    std::uint64_t rows = 0;  // of the files that the level is in
    for (const Piece& piece : plan.pieces) {
      auto known = plan.metas.find(piece.file);
      if (known == plan.metas.end()) {
        auto meta = meta_of(plan.names[piece.file]);
        if (!meta) return propagate(meta);
        plan.sh_degree = std::max(plan.sh_degree, meta->version == 2 ? meta->sh_degree : meta->has_sh ? 3 : 0);
        rows += meta->count;
        known = plan.metas.emplace(piece.file, std::move(*meta)).first;
        // Whole files are decoded, however few of their rows a level has.
        if (plan.metas.size() > max_level_files || rows > most_rows)
          return fail(ErrorCode::too_large,
                      "the level lies in more than " + std::to_string(max_level_files) +
                          " files, or in files of more than " + std::to_string(most_rows) +
                          " Gaussians together, twice the limit (max_gaussians)",
                      where(name) + ":filenames");
      }
      if (piece.offset + piece.count > known->second.count)
        return fail(ErrorCode::corrupt_data,
                    "rows " + std::to_string(piece.offset) + " to " + std::to_string(piece.offset + piece.count) +
                        " of " + std::to_string(known->second.count),
                    where(plan.names[piece.file]));
    }
    return {};
  }

  /// Which rows of which files make the level that is asked for, in the order of the tree.
  Result<Plan> plan_of(const std::string& name) {
    const auto document = parsed(name, max_lod_meta_bytes);
    if (!document) return propagate(document);
    std::optional<Error> error;
    const JsonFields root(document->tree, where(name) + ":", error);
    Plan plan;
    const JsonFields names = root.at("filenames");
    if (names.size() > max_lod_files)
      return fail(ErrorCode::too_large,
                  std::to_string(names.size()) + " files; at most " + std::to_string(max_lod_files) + " are read",
                  where(name) + ":filenames");
    std::set<std::string> known_names;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto safe = safe_name(parent_of(name), names.at(i).string());
      if (!safe)
        names.at(i).fail_here("the name of a file in the scene's own folder was expected, without a way out of it");
      // A file is decoded once for each time that it is named.
      else if (!known_names.insert(*safe).second)
        names.at(i).fail_here("the file is named twice");
      plan.names.push_back(safe.value_or(""));
    }
    plan.levels = int(whole(root.at("lodLevels"), 1000));
    if (plan.levels == 0) root.at("lodLevels").fail_here("a streamed scene has a level at least");
    plan.has_environment = root.has_value("environment");
    if (!error && (options_.level < 0 || options_.level >= plan.levels))
      return fail(ErrorCode::invalid_argument,
                  "there is no level " + std::to_string(options_.level) +
                      " of detail; the scene has 0, the finest, to " + std::to_string(plan.levels - 1),
                  where(name) + ":lodLevels");
    // A stack of our own, and of limited depth: how deep the tree goes, the file says. It holds where each level is
    // among its siblings, not the siblings: of those, there may be millions.
    struct Siblings {
      JsonFields nodes;
      std::size_t next = 0;
    };
    std::vector<Siblings> open;
    JsonFields node = root.at("tree");
    for (bool more = true; more && !error;) {
      if (node.has("lods")) add_piece(node.at("lods"), plan);
      if (node.has("children")) {
        if (open.size() == max_lod_depth)
          node.at("children").fail_here("the tree is deeper than " + std::to_string(max_lod_depth));
        open.push_back({node.at("children")});
      }
      while (!open.empty() && open.back().next == open.back().nodes.size()) open.pop_back();
      more = !open.empty();
      if (more) node = open.back().nodes.at(open.back().next++);
    }
    if (error) return tl::make_unexpected(std::move(*error));
    if (auto found = find_files(name, plan); !found) return propagate(found);
    return plan;
  }

  Result<scene::GaussianCloud> read_streamed(const std::string& name, SceneOrigin& origin) {
    const auto plan = plan_of(name);
    if (!plan) return propagate(plan);
    // One file is in memory beside the whole.
    std::uint64_t largest = 0;
    for (const auto& [file, meta] : plan->metas) {
      note(meta, origin);
      largest = std::max(largest, meta.count);
    }
    if (plan->levels > 1)
      origin.left_out.push_back("of " + std::to_string(plan->levels) + " levels of detail, all but level " +
                                std::to_string(options_.level));
    if (plan->has_environment) origin.left_out.push_back("the environment, which a viewer shows around every level");
    if (auto checked = check_limits(plan->count, cloud_row_bytes(plan->sh_degree), options_, files_.file); !checked)
      return propagate(checked);
    const auto lent = take_from(options_.memory, largest * cloud_row_bytes(plan->sh_degree), files_.file);
    if (!lent) return propagate(lent);
    scene::GaussianCloud cloud;
    cloud.sh_degree = plan->sh_degree;
    cloud.resize(plan->count);
    std::map<std::size_t, std::vector<std::pair<const Piece*, std::size_t>>> places;  // of pieces in the whole, by file
    std::size_t to = 0;
    for (const Piece& piece : plan->pieces) {
      places[piece.file].emplace_back(&piece, to);
      to += std::size_t(piece.count);
    }
    for (const auto& [file, meta] : plan->metas) {
      const auto part = decode(meta);
      if (!part) return propagate(part);
      for (const auto& [piece, at] : places[file])
        copy_rows(*part, std::size_t(piece->offset), std::size_t(piece->count), cloud, at);
    }
    note_inexact(origin);
    scene::drop_empty_sh_bands(cloud);
    return cloud;
  }

  static void copy_rows(const scene::GaussianCloud& from, std::size_t first, std::size_t count,
                        scene::GaussianCloud& to, std::size_t at) {
    const std::size_t in = scene::sh_coefficients(from.sh_degree), out = scene::sh_coefficients(to.sh_degree);
    each_row(count, [&](std::size_t i) {
      to.mean.set(at + i, from.mean.get(first + i));
      to.log_scale.set(at + i, from.log_scale.get(first + i));
      to.rotation.set(at + i, from.rotation.get(first + i));
      to.opacity_logit[at + i] = from.opacity_logit[first + i];
      for (std::size_t c = 0; c < 3; ++c)
        std::copy_n(from.sh_row(first + i).begin() + std::ptrdiff_t(c * in), std::min(in, out),
                    to.sh_row(at + i).begin() + std::ptrdiff_t(c * out));
    });
  }

 public:
  /// Components in the order w, x, y, z; the largest is left out and positive.
  static Quat unpack_rotation(std::array<std::uint8_t, 4> bytes) {
    const auto largest = std::size_t(bytes[3] - rotation_mode);
    std::array<double, 4> q{};
    double square = 0;
    std::size_t next = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      if (c == largest) continue;
      q[c] = (bytes[next++] / 255.0 - 0.5) * std::numbers::sqrt2;
      square += q[c] * q[c];
    }
    q[largest] = std::sqrt(std::max(0.0, 1.0 - square));
    return {float(q[0]), float(q[1]), float(q[2]), float(q[3])};
  }

 private:
  Files files_;
  const ReadOptions& options_;
  std::vector<std::string> inexact_;
};

/// The files of an archive, and the one that says what they are.
struct Bundle {
  Files files;
  std::string root;
};

Result<Bundle> open_bundle(const ZipArchive& archive, const std::string& file, MemoryBudget* memory) {
  // At the root, or in one folder, as a person zips one.
  for (const char* wanted : {lod_meta_name, meta_name}) {
    const std::string* found = nullptr;
    for (const auto& [name, index] : archive.names())
      if (fs::path(name).filename() == wanted && std::ranges::count(name, '/') <= 1 &&
          (!found || name.size() < found->size()))
        found = &name;
    if (!found) continue;
    Files files{file, [&archive, memory](const std::string& name, std::uint64_t most) {
                  return archive.read(name, most, memory);
                }};
    return Bundle{std::move(files), *found};
  }
  return fail(ErrorCode::unsupported,
              file +
                  " is a zip file, but there is no meta.json of a SOG scene in it: a dataset is sent to the scene's "
                  "dataset; a scene in a zip file is unpacked first",
              file);
}

std::uint64_t spread_bits(std::uint64_t x) {
  // Two zeros between any two of 16 bits.
  x = (x | x << 32) & 0x00ff00000000ffffULL;
  x = (x | x << 16) & 0x00ff0000ff0000ffULL;
  x = (x | x << 8) & 0xf00f00f00f00f00fULL;
  x = (x | x << 4) & 0x30c30c30c30c30c3ULL;
  return (x | x << 2) & 0x9249249249249249ULL;
}

/// Positions as the format holds them.
struct Positions {
  std::array<double, 3> low{}, high{};

  explicit Positions(const scene::GaussianCloud& cloud) {
    const scene::Bounds bounds = scene::bounds(cloud);
    for (int c = 0; c < 3; ++c)
      low[std::size_t(c)] = logarithm(bounds.low[c]), high[std::size_t(c)] = logarithm(bounds.high[c]);
  }
  static double logarithm(float x) { return std::copysign(std::log1p(std::abs(double(x))), double(x)); }
  [[nodiscard]] std::array<std::uint32_t, 3> pack(Vec3 mean) const {
    std::array<std::uint32_t, 3> q{};
    for (std::size_t c = 0; c < 3; ++c)
      if (high[c] > low[c])
        q[c] = std::uint32_t(
            std::clamp(std::round((logarithm(mean[int(c)]) - low[c]) / (high[c] - low[c]) * 65535.0), 0.0, 65535.0));
    return q;
  }
};

std::array<std::uint8_t, 4> pack_rotation_once(Quat rotation) {
  const auto [largest, rest] = smallest_three(rotation);
  std::array<std::uint8_t, 4> bytes{};
  for (std::size_t c = 0; c < rest.size(); ++c) bytes[c] = nearest_byte(rest[c] * 255.0);
  bytes[3] = std::uint8_t(rotation_mode + int(largest));
  return bytes;
}

std::array<std::uint8_t, 4> pack_rotation(Quat rotation) {
  return stable_rotation(rotation, pack_rotation_once, Sog::unpack_rotation);
}

BytePicture picture_for(std::size_t count) {
  BytePicture picture;
  // Near square, with sides of multiples of 4, as others write them.
  picture.width = (std::size_t(std::ceil(std::sqrt(double(count)))) + 3) / 4 * 4;
  picture.height = ((count + picture.width - 1) / picture.width + 3) / 4 * 4;
  picture.rgba.assign(4 * picture.pixels(), 0);
  for (std::size_t i = 0; i < picture.pixels(); ++i) picture.pixel(i)[3] = 255;
  return picture;
}

/// SH beyond DC as a palette of indices into a codebook: entries that differ, in ascending order.
struct ShPalette {
  Codebook codebook;
  std::size_t coefficients = 0;       ///< Per channel, without DC.
  std::vector<std::uint8_t> entries;  ///< [count][coefficients][3]
  std::vector<std::uint32_t> labels;  ///< [N]

  [[nodiscard]] std::size_t count() const { return entries.size() / (3 * coefficients); }
};

ShPalette sh_palette(const scene::GaussianCloud& cloud, const std::vector<std::uint32_t>& order) {
  const std::size_t all = scene::sh_coefficients(cloud.sh_degree), kept = all - 1, d = 3 * kept;
  std::vector<float> rows(order.size() * d);
  parallel_for(order.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t k = 0; k < kept; ++k)
        for (std::size_t c = 0; c < 3; ++c)
          rows[i * d + 3 * k + c] = cloud.sh_row(order[i])[c * all + k + 1] + 0.0f;  // +0: one zero, not two
  });
  // A power of two that is at least half of the rows, as others write them: beyond it, the palette outweighs its use.
  std::size_t most = 1024;
  while (2 * most <= order.size() && most < max_palette) most *= 2;
  const Palette palette = palette_of(rows, d, most, max_palette);
  ShPalette out;
  out.coefficients = kept;
  out.codebook = codebook_of(palette.entries);
  const std::size_t count = palette.entries.size() / d;
  std::vector<std::uint8_t> indices(palette.entries.size());
  for (std::size_t j = 0; j < indices.size(); ++j) indices[j] = out.codebook.nearest(palette.entries[j]);
  const auto entry = [&](std::uint32_t k) { return std::span(indices).subspan(k * d, d); };
  std::vector<std::uint32_t> sorted(count), place(count);
  std::iota(sorted.begin(), sorted.end(), 0u);
  std::ranges::sort(sorted, [&](std::uint32_t a, std::uint32_t b) {
    return std::ranges::lexicographical_compare(entry(a), entry(b));
  });
  for (std::size_t k = 0; k < count; ++k) {
    if (k == 0 || !std::ranges::equal(entry(sorted[k - 1]), entry(sorted[k])))
      out.entries.insert(out.entries.end(), entry(sorted[k]).begin(), entry(sorted[k]).end());
    place[sorted[k]] = std::uint32_t(out.count() - 1);
  }
  out.labels.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i) out.labels[i] = place[palette.labels[i]];
  return out;
}

json as_json(const Codebook& codebook) {
  json values = json::array();
  for (const float value : codebook.values) values.push_back(double(value));
  return values;
}

}  // namespace

bool looks_like_sog_meta(std::span<const std::byte> start) {
  const std::string_view text(reinterpret_cast<const char*>(start.data()), start.size());
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && text[first] == '{';
}

std::uint64_t expected_sog_bytes(std::span<const std::byte> zip, const ReadOptions& options) {
  const auto size = within_memory("", [&]() -> Result<std::pair<std::uint64_t, int>> {
    const auto archive = ZipArchive::open(zip, "");
    if (!archive) return propagate(archive);
    auto bundle = open_bundle(*archive, "", options.memory);
    if (!bundle) return propagate(bundle);
    return Sog(std::move(bundle->files), options).size(bundle->root);
  });
  if (!size) return zip.size();
  return std::max<std::uint64_t>(zip.size(), size->first * cloud_row_bytes(size->second));
}

Result<DecodedScene> decode_sog(std::span<const std::byte> zip, const std::string& file, const ReadOptions& options) {
  const auto archive = ZipArchive::open(zip, file);
  if (!archive) return propagate(archive);
  auto bundle = open_bundle(*archive, file, options.memory);
  if (!bundle) return propagate(bundle);
  return Sog(std::move(bundle->files), options).read(bundle->root);
}

Result<DecodedScene> read_sog_folder(const fs::path& folder, const ReadOptions& options) {
  std::error_code error;
  const fs::path home = fs::canonical(folder, error);
  if (error) return tl::make_unexpected(file_error(error.value(), "read", folder));
  const std::string name = home.filename().string();
  const auto read = [&](const std::string& relative, std::uint64_t most) -> Result<UnpackedFile> {
    const std::string where = name + ":" + relative;
    // A link may lead out of the folder, whatever the name says.
    std::error_code unresolved;
    const fs::path path = fs::canonical(home / relative, unresolved);
    if (!unresolved && std::mismatch(home.begin(), home.end(), path.begin(), path.end()).first != home.end())
      return fail(ErrorCode::corrupt_data, "the file lies outside of the scene's folder", where);
    const auto file = InputFile::open(home / relative);
    if (!file) return tl::make_unexpected(Error{file.error().code, file.error().message, where});
    if (file->size() > most)
      return fail(ErrorCode::too_large,
                  "the file has " + std::to_string(file->size()) + " bytes; at most " + std::to_string(most) +
                      " make sense here",
                  where);
    auto lent = take_from(options.memory, file->size(), where);
    if (!lent) return propagate(lent);
    auto bytes = file->read_at(0, file->size());
    if (!bytes) return propagate(bytes);
    return UnpackedFile{std::move(*bytes), std::move(*lent)};
  };
  const auto has = [&](const std::string& relative) { return fs::is_regular_file(home / relative, error); };
  for (const char* root : {lod_meta_name, meta_name})
    if (has(root)) return Sog(Files{name, read}, options).read(root);
  return fail(ErrorCode::invalid_argument,
              folder.string() + " is a folder without meta.json or lod-meta.json; expected a file", folder.string());
}

std::vector<std::uint32_t> sog_order(const scene::GaussianCloud& cloud) {
  const Positions positions(cloud);
  std::vector<std::uint64_t> codes(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const auto q = positions.pack(cloud.mean.get(i));
    codes[i] = spread_bits(q[0]) | spread_bits(q[1]) << 1 | spread_bits(q[2]) << 2;
  }
  std::vector<std::uint32_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, [&](std::uint32_t a, std::uint32_t b) { return codes[a] < codes[b]; });
  return order;
}

namespace {

/// The pictures of a file, as they are made.
class Pictures {
 public:
  ///   n     rows
  ///   file  for error addresses
  Pictures(std::size_t n, const std::string& file) : n_(n), file_(file) {}

  Result<void> add(const char* name, const BytePicture& picture) {
    auto bytes = encode_webp(picture, file_);
    if (!bytes) return propagate(bytes);
    files_.push_back({name, std::move(*bytes)});
    return {};
  }
  /// A picture whose pixel i is made by fill(i-th row in order, its four bytes).
  template <class Fill>
  Result<void> add_rows(const char* name, Fill&& fill) {
    BytePicture picture = picture_for(n_);
    parallel_for(n_, rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) fill(i, picture.pixel(i));
    });
    return add(name, picture);
  }
  [[nodiscard]] std::vector<NamedFile> take() { return std::move(files_); }

 private:
  std::size_t n_;
  const std::string& file_;
  std::vector<NamedFile> files_;
};

/// The bands beyond 0, as a palette and each row's entry of it.
Result<void> add_sh(const scene::GaussianCloud& cloud, const std::vector<std::uint32_t>& order, Pictures& pictures,
                    json& meta) {
  if (cloud.sh_degree == 0) return {};
  const ShPalette palette = sh_palette(cloud, order);
  meta["shN"] = {{"count", palette.count()},
                 {"bands", cloud.sh_degree},
                 {"codebook", as_json(palette.codebook)},
                 {"files", json::array({"shN_centroids.webp", "shN_labels.webp"})}};
  BytePicture centroids;
  centroids.width = palette_columns * palette.coefficients;
  centroids.height = (palette.count() + palette_columns - 1) / palette_columns;
  centroids.rgba.assign(4 * centroids.pixels(), 0);
  for (std::size_t i = 0; i < centroids.pixels(); ++i) centroids.pixel(i)[3] = 255;
  for (std::size_t j = 0; j < palette.entries.size(); ++j)  // entries lie one after the other: 64 fill a row of pixels
    centroids.pixel(j / 3)[j % 3] = palette.entries[j];
  if (auto added = pictures.add("shN_centroids.webp", centroids); !added) return propagate(added);
  if (auto added = pictures.add_rows("shN_labels.webp",
                                     [&](std::size_t i, std::uint8_t* rgba) {
                                       rgba[0] = std::uint8_t(palette.labels[i] & 255u);
                                       rgba[1] = std::uint8_t(palette.labels[i] >> 8);
                                     });
      !added)
    return propagate(added);
  return {};
}

}  // namespace

Result<std::vector<std::byte>> encode_sog(const scene::GaussianCloud& cloud, bool antialiased,
                                          const std::string& file) {
  const auto order = sog_order(cloud);
  const std::size_t n = order.size(), coefficients = scene::sh_coefficients(cloud.sh_degree);
  const Positions positions(cloud);
  Pictures pictures(n, file);
  std::vector<float> values;
  for (const auto* axis : {&cloud.log_scale.x, &cloud.log_scale.y, &cloud.log_scale.z})
    values.insert(values.end(), axis->begin(), axis->end());
  const Codebook scales = codebook_of(values);
  values.clear();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t c = 0; c < 3; ++c) values.push_back(cloud.sh_row(i)[c * coefficients]);
  const Codebook colours = codebook_of(values);
  values = {};

  json meta = {{"version", 2}, {"asset", {{"generator", "splatdrag"}}}, {"count", n}, {"antialias", antialiased}};
  meta["means"] = {
      {"mins", positions.low}, {"maxs", positions.high}, {"files", json::array({"means_l.webp", "means_u.webp"})}};
  for (const int shift : {0, 8})
    if (auto added = pictures.add_rows(shift == 0 ? "means_l.webp" : "means_u.webp",
                                       [&](std::size_t i, std::uint8_t* rgba) {
                                         const auto q = positions.pack(cloud.mean.get(order[i]));
                                         for (std::size_t c = 0; c < 3; ++c)
                                           rgba[c] = std::uint8_t(q[c] >> shift & 255u);
                                       });
        !added)
      return propagate(added);
  meta["scales"] = {{"codebook", as_json(scales)}, {"files", json::array({"scales.webp"})}};
  if (auto added = pictures.add_rows("scales.webp",
                                     [&](std::size_t i, std::uint8_t* rgba) {
                                       const Vec3 scale = cloud.log_scale.get(order[i]);
                                       for (std::size_t c = 0; c < 3; ++c) rgba[c] = scales.nearest(scale[int(c)]);
                                     });
      !added)
    return propagate(added);
  meta["quats"] = {{"files", json::array({"quats.webp"})}};
  if (auto added = pictures.add_rows("quats.webp",
                                     [&](std::size_t i, std::uint8_t* rgba) {
                                       const auto bytes = pack_rotation(cloud.rotation.get(order[i]));
                                       std::ranges::copy(bytes, rgba);
                                     });
      !added)
    return propagate(added);
  meta["sh0"] = {{"codebook", as_json(colours)}, {"files", json::array({"sh0.webp"})}};
  if (auto added = pictures.add_rows("sh0.webp",
                                     [&](std::size_t i, std::uint8_t* rgba) {
                                       for (std::size_t c = 0; c < 3; ++c)
                                         rgba[c] = colours.nearest(cloud.sh_row(order[i])[c * coefficients]);
                                       rgba[3] = byte_of_logit(cloud.opacity_logit[order[i]]);
                                     });
      !added)
    return propagate(added);
  if (auto added = add_sh(cloud, order, pictures, meta); !added) return propagate(added);
  const std::string text = meta.dump();
  const auto bytes = std::as_bytes(std::span(text));
  std::vector<NamedFile> files = pictures.take();
  files.insert(files.begin(), {meta_name, {bytes.begin(), bytes.end()}});  // first: a reader needs it first
  auto zip = make_zip(files);
  if (!zip) return propagate(zip);
  return zip;
}

}  // namespace engine::io
