#include "engine/io/glb.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/parallel.h"
#include "engine/io/axes.h"
#include "engine/io/checks.h"
#include "engine/io/json_fields.h"
#include "engine/io/quantised.h"
#include "engine/io/spz.h"

namespace engine::io {
namespace {

using nlohmann::json;

constexpr std::size_t rows_per_task = 4096;  // of a parallel task: a choice
constexpr std::uint32_t magic = 0x46546c67, json_chunk = 0x4e4f534a,
                        binary_chunk = 0x004e4942;  // "glTF" "JSON" "BIN\0"
constexpr std::uint32_t signed_byte = 5120, unsigned_byte = 5121, signed_short = 5122, unsigned_short = 5123,
                        float32 = 5126;              // of glTF's componentType
constexpr int points_mode = 0;                       // of glTF's primitive.mode
constexpr std::string_view axes = "LUF";             // of glTF
constexpr int max_depth = 64;                        // of nodes within nodes: a choice
constexpr std::uint64_t max_json_bytes = 16u << 20;  // a choice: as a tree, 50 times that; a million nodes have it
constexpr std::size_t max_primitives = 1'000'000, max_splats = 10'000;  // of all nodes, and with Gaussians: choices
constexpr double most_uneven = 1e-4;  // relative, of what counts as a uniform scale: rounding of a printed matrix
constexpr const char* extension = "KHR_gaussian_splatting";
constexpr std::array compressions = {"KHR_gaussian_splatting_compression_spz_2",
                                     "KHR_gaussian_splatting_compression_spz"};
constexpr const char* prefix = "KHR_gaussian_splatting:";
/// Extensions that a file may require without changing where its Gaussians are or what they look like.
constexpr std::array harmless = {"KHR_materials_unlit", "KHR_mesh_quantization"};

std::string attribute(const std::string& name) { return prefix + name; }
std::string sh_name(int degree, int k) {
  return attribute("SH_DEGREE_" + std::to_string(degree) + "_COEF_" + std::to_string(k));
}

/// x_in_scene = linear * x_in_node + shift.
struct Placement {
  DMat3 linear{1.0};
  DVec3 shift{0.0};
};

/// A primitive of Gaussians, where its node puts it.
struct Splats {
  Placement placement;
  std::size_t mesh = 0, primitive = 0;
  std::string node;  ///< Address, for errors.
  std::uint64_t count = 0;
  int sh_degree = 0;
  std::span<const std::byte> spz;  ///< Where the primitive is compressed.
};

/// Values of one attribute, as the file holds them. Checked: at() stays within the bytes.
struct Values {
  std::span<const std::byte> bytes;
  std::uint64_t count = 0;
  std::size_t stride = 0, channels = 0;
  std::uint32_t type = float32;
  bool normalized = false;

  [[nodiscard]] float at(std::size_t row, std::size_t channel) const {
    const std::byte* from = bytes.data() + row * stride + channel * size_of(type);
    const auto read = [&]<class T>(T value) {
      std::memcpy(&value, from, sizeof value);
      if constexpr (std::is_same_v<T, float>) return value;
      const float most = float(std::numeric_limits<T>::max());
      return normalized ? std::max(float(value) / most, -1.0f) : float(value);
    };
    switch (type) {
      case signed_byte:
        return read(std::int8_t{});
      case unsigned_byte:
        return read(std::uint8_t{});
      case signed_short:
        return read(std::int16_t{});
      case unsigned_short:
        return read(std::uint16_t{});
      default:
        return read(float{});
    }
  }
  static std::size_t size_of(std::uint32_t type) {
    return type == signed_byte || type == unsigned_byte ? 1 : type == signed_short || type == unsigned_short ? 2 : 4;
  }
};

class Glb {
 public:
  Glb(std::span<const std::byte> bytes, std::string file, const ReadOptions& options)
      : bytes_(bytes), file_(std::move(file)), options_(options) {}

  /// What there is, without decoding it, and within the limits.
  Result<void> survey() {
    if (auto opened = open(); !opened) return opened;
    const JsonFields root(tree_, file_ + ":", error_);
    check_required(root);
    if (!error_) find_splats(root);
    if (error_) return tl::make_unexpected(*error_);
    if (splats_.empty())
      return fail(ErrorCode::unsupported,
                  file_ + " holds no Gaussians in its scene: KHR_gaussian_splatting is on none of its primitives",
                  file_);
    return {};
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] int sh_degree() const { return sh_degree_; }

  Result<DecodedScene> decode() {
    if (auto done = survey(); !done) return propagate(done);
    DecodedScene scene;
    // Mostly, one SPZ part is the whole scene: it needs no second cloud to be copied into.
    if (splats_.size() == 1 && !splats_.front().spz.empty()) {
      auto part = spz_part(splats_.front());
      if (!part) return propagate(part);
      scene.cloud = std::move(*part);
    } else if (auto done = decode_all(scene.cloud); !done) {
      return propagate(done);
    }
    const bool compressed = std::ranges::any_of(splats_, [](const Splats& splats) { return !splats.spz.empty(); });
    scene.origin.format = SceneFormat::glb;
    scene.origin.version = 2;
    scene.origin.axes = axes;
    scene.origin.packing = compressed ? "SPZ within glTF" : "none";
    scene.origin.antialiased = antialiased_;
    scene.origin.left_out = std::move(left_out_);
    if (auto finite = check_finite(scene.cloud, file_); !finite) return propagate(finite);
    return scene;
  }

 private:
  /// The draft of 2025 had the logarithm of the scale, what was ratified has the scale. No scale is negative, and
  /// hardly a scene has no Gaussian smaller than its unit. Asked of the whole file: one of its primitives may have
  /// none.
  bool has_logarithms() {
    const JsonFields root(tree_, file_ + ":", error_);
    for (const Splats& splats : splats_) {
      if (!splats.spz.empty()) continue;
      const Values scale = values(root, attributes_of(root, splats), attribute("SCALE"), "VEC3");
      for (std::size_t i = 0; i < scale.count && !error_; ++i)
        for (std::size_t c = 0; c < 3; ++c)
          if (scale.at(i, c) < 0) return true;
    }
    return false;
  }
  JsonFields attributes_of(const JsonFields& root, const Splats& splats) {
    return member(root, "meshes", splats.mesh).at("primitives").at(splats.primitive).at("attributes");
  }

  Result<void> decode_all(scene::GaussianCloud& cloud) {
    logarithmic_ = has_logarithms();
    if (error_) return tl::make_unexpected(*error_);
    cloud.sh_degree = sh_degree_;
    cloud.resize(count_);
    std::size_t at = 0;
    for (const Splats& splats : splats_) {
      auto done = splats.spz.empty() ? decode_attributes(splats, cloud, at) : copy_spz_part(splats, cloud, at);
      if (!done) return done;
      at += std::size_t(splats.count);
    }
    return {};
  }

  tl::unexpected<Error> damaged(const std::string& message, const std::string& where) const {
    return fail(ErrorCode::corrupt_data, message + ": the file is damaged or incomplete, copy or download it again",
                where);
  }

  Result<void> open() {
    const std::string where = file_ + ":header";
    ByteReader in(bytes_);
    (void)in.read<std::uint32_t>();
    const auto version = in.read<std::uint32_t>(), length = in.read<std::uint32_t>();
    if (!in.ok()) return damaged("a .glb file begins with 12 bytes; fewer are there", where);
    if (version != 2)
      return fail(ErrorCode::unsupported, "glTF version " + std::to_string(version) + "; 2 is read", where);
    if (length != bytes_.size())
      return damaged(
          "the header says " + std::to_string(length) + " bytes; the file has " + std::to_string(bytes_.size()), where);
    std::span<const std::byte> text;
    for (bool first = true; in.remaining() > 0; first = false) {
      const auto size = in.read<std::uint32_t>(), type = in.read<std::uint32_t>();
      const auto chunk = in.take(size);
      if (!in.ok()) return damaged("a chunk is longer than the file", where);
      if (first != (type == json_chunk)) return damaged("the first chunk, and it alone, is JSON", where);
      if (first) text = chunk;
      if (type == binary_chunk && binary_.empty()) binary_ = chunk;
    }
    if (text.empty()) return damaged("there is no JSON", where);
    if (text.size() > max_json_bytes)
      return fail(ErrorCode::too_large,
                  "the JSON has " + std::to_string(text.size()) + " bytes; at most " + std::to_string(max_json_bytes) +
                      " are read",
                  file_ + ":json");
    auto lent = take_from(options_.memory, json_tree_bytes(text), file_);
    if (!lent) return propagate(lent);
    tree_memory_ = std::move(*lent);
    auto tree = parse_json(text, file_ + ":json");
    if (!tree) return propagate(tree);
    tree_ = std::move(*tree);
    return {};
  }

  void refuse(std::string message, std::string where) {
    if (!error_) error_ = Error{ErrorCode::unsupported, std::move(message), std::move(where)};
  }

  void check_required(const JsonFields& root) {
    if (!root.has("extensionsRequired")) return;
    const JsonFields required = root.at("extensionsRequired");
    for (std::size_t i = 0; i < required.size(); ++i) {
      const std::string name = required.at(i).string();
      if (name == extension || std::ranges::count(compressions, name) > 0 || std::ranges::count(harmless, name) > 0)
        continue;
      return refuse("the file requires an extension that is not known here: export it without", required.at(i).where());
    }
  }

  std::size_t index(const JsonFields& field, std::size_t size) {
    const double value = field.number();
    if (value >= 0 && value < double(size) && value == std::floor(value)) return std::size_t(value);
    field.fail_here("expected an index below " + std::to_string(size));
    return 0;
  }
  static std::size_t size_of(const JsonFields& root, const char* key) {
    return root.has(key) ? root.at(key).size() : 0;
  }

  /// Member `i` of an array that has one; nothing but an error where it has not.
  JsonFields member(const JsonFields& root, const char* key, std::size_t i) { return root.at(key).at(i); }

  void find_splats(const JsonFields& root) {
    const std::size_t nodes = size_of(root, "nodes"), meshes = size_of(root, "meshes");
    std::vector<std::size_t> roots;
    if (const std::size_t scenes = size_of(root, "scenes"); scenes > 0) {
      const std::size_t scene = root.has("scene") ? index(root.at("scene"), scenes) : 0;
      if (error_) return;
      const JsonFields fields = member(root, "scenes", scene);
      if (fields.has("nodes"))
        for (std::size_t i = 0; i < fields.at("nodes").size(); ++i)
          roots.push_back(index(fields.at("nodes").at(i), nodes));
    } else {
      roots = parentless(root, nodes);
    }
    struct Open {
      std::size_t node;
      Placement placement;  ///< Of its parent.
      int depth;
    };
    std::vector<Open> open;
    std::vector<bool> seen(nodes);
    // glTF's nodes are trees: each has one parent, and none is above itself. Asked before one is put down, so that
    // there are never more than the file has.
    const auto put = [&](Open next) {
      if (error_) return;
      if (seen[next.node])
        return member(root, "nodes", next.node).fail_here("the node is in the scene twice, or below itself");
      seen[next.node] = true;
      open.push_back(next);
    };
    for (std::size_t i = roots.size(); i-- > 0;) put({roots[i], {}, 0});
    while (!open.empty() && !error_) {
      const Open next = open.back();
      open.pop_back();
      const JsonFields node = member(root, "nodes", next.node);
      if (next.depth > max_depth) return node.fail_here("nodes lie more than " + std::to_string(max_depth) + " deep");
      const Placement own = placement_of(node);
      const Placement placement{next.placement.linear * own.linear,
                                next.placement.linear * own.shift + next.placement.shift};
      if (node.has("children")) {
        const JsonFields children = node.at("children");
        for (std::size_t i = children.size(); i-- > 0;) put({index(children.at(i), nodes), placement, next.depth + 1});
      }
      if (node.has("mesh") && !error_) add_mesh(root, node, index(node.at("mesh"), meshes), placement);
    }
  }

  std::vector<std::size_t> parentless(const JsonFields& root, std::size_t nodes) {
    std::vector<bool> has_parent(nodes);
    for (std::size_t i = 0; i < nodes; ++i) {
      const JsonFields node = member(root, "nodes", i);
      if (!node.has("children")) continue;
      for (std::size_t k = 0; k < node.at("children").size() && !error_; ++k)
        has_parent[index(node.at("children").at(k), nodes)] = true;
    }
    std::vector<std::size_t> roots;
    for (std::size_t i = 0; i < nodes; ++i)
      if (!has_parent[i]) roots.push_back(i);
    return roots;
  }

  static Placement placement_of(const JsonFields& node) {
    Placement placement;
    if (node.has("matrix")) {
      std::array<double, 16> m{};
      node.at("matrix").numbers(m.data(), m.size());
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) placement.linear[c][r] = m[std::size_t(4 * c + r)];
      placement.shift = {m[12], m[13], m[14]};
      return placement;
    }
    if (node.has("translation")) node.at("translation").numbers(&placement.shift.x, 3);
    DVec3 scale(1.0);
    if (node.has("scale")) node.at("scale").numbers(&scale.x, 3);
    if (node.has("rotation")) {
      std::array<double, 4> q{};  // x, y, z, w
      node.at("rotation").numbers(q.data(), q.size());
      const DQuat rotation(q[3], q[0], q[1], q[2]);
      if (!(glm::dot(rotation, rotation) > 0.5 && glm::dot(rotation, rotation) < 2))
        node.at("rotation").fail_here("expected a quaternion of unit length");
      placement.linear = glm::mat3_cast(glm::normalize(rotation));
    }
    for (int c = 0; c < 3; ++c) placement.linear[c] *= scale[c];
    return placement;
  }

  void add_mesh(const JsonFields& root, const JsonFields& node, std::size_t mesh, const Placement& placement) {
    if (error_) return;
    const JsonFields primitives = member(root, "meshes", mesh).at("primitives");
    for (std::size_t i = 0; i < primitives.size() && !error_; ++i) {
      const JsonFields primitive = primitives.at(i);
      // Nodes share meshes: a short text may name a trillion primitives.
      if (++primitives_ > max_primitives) return too_many("primitives", max_primitives, node.where());
      if (!primitive.has("extensions") || !primitive.at("extensions").has(extension)) {
        leave_out("meshes of triangles, lines or points");
        continue;
      }
      if (!primitive.has("mode") || primitive.at("mode").number() != points_mode)
        return primitive.fail_here("Gaussians are points (mode 0)");
      const JsonFields gaussians = primitive.at("extensions").at(extension);
      if (gaussians.has("kernel") && gaussians.at("kernel").string() != "ellipse")
        return refuse("the Gaussians have a kernel that is not known here; 'ellipse' is",
                      gaussians.where() + ".kernel");
      if (gaussians.has("colorSpace") && gaussians.at("colorSpace").string() != "srgb_rec709_display")
        leave_out("that colours are meant in another space than BT.709 sRGB: they are taken as they are");
      check_placement(placement, node.where());
      Splats splats{placement, mesh, i, node.where(), 0, 0, {}};
      survey_primitive(root, primitive, gaussians, splats);
      if (error_) return;
      if (splats_.size() == max_splats) return too_many("primitives of Gaussians", max_splats, node.where());
      count_ += splats.count;
      sh_degree_ = std::max(sh_degree_, splats.sh_degree);
      splats_.push_back(std::move(splats));
      if (auto checked = check_limits(count_, cloud_row_bytes(sh_degree_), options_, file_); !checked)
        error_ = checked.error();
    }
  }

  void too_many(const char* what, std::size_t most, const std::string& where) {
    error_ = Error{ErrorCode::too_large,
                   std::string("the nodes of the scene hold more than ") + std::to_string(most) + " " + what, where};
  }

  void leave_out(std::string what) {
    if (std::ranges::count(left_out_, what) == 0) left_out_.push_back(std::move(what));
  }

  void check_placement(const Placement& placement, const std::string& node) {
    const double scale = scale_of(placement);
    const DMat3 square = glm::transpose(placement.linear) * placement.linear;
    double worst = 0;
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r)
        worst = std::max(worst, std::abs(square[c][r] / (scale * scale) - (c == r ? 1.0 : 0.0)));
    if (!(scale > 0 && std::isfinite(scale) && worst < most_uneven))
      refuse(
          "the node, or one above it, scales unevenly or shears: Gaussians can follow a rotation, a shift, a mirror "
          "and one scale for all axes; apply the node's scale to the Gaussians before export",
          node);
  }
  static double scale_of(const Placement& placement) { return std::cbrt(std::abs(glm::determinant(placement.linear))); }

  void survey_primitive(const JsonFields& root, const JsonFields& primitive, const JsonFields& gaussians,
                        Splats& splats) {
    if (gaussians.has("extensions"))
      for (const char* name : compressions)
        if (gaussians.at("extensions").has(name)) {
          splats.spz = view(root, gaussians.at("extensions").at(name).at("bufferView"));
          if (error_) return;
          const auto header = read_spz_header(splats.spz, primitive.where());
          if (!header) {
            error_ = header.error();
            return;
          }
          splats.count = header->count, splats.sh_degree = header->sh_degree;
          return;
        }
    const JsonFields attributes = primitive.at("attributes");
    const Values position = values(root, attributes, "POSITION", "VEC3");
    splats.count = position.count;
    for (int degree = 1; degree <= scene::max_sh_degree + 1; ++degree) {
      int present = 0;
      for (int k = 0; k < 2 * degree + 1; ++k) present += attributes.has(sh_name(degree, k).c_str()) ? 1 : 0;
      if (present == 0) break;
      if (degree > scene::max_sh_degree)
        return refuse("SH degree 4; 0 to 3 is supported: export with degree 3", attributes.where());
      if (present != 2 * degree + 1)
        return attributes.fail_here("some coefficients of SH degree " + std::to_string(degree) + " are missing");
      splats.sh_degree = degree;
    }
  }

  std::span<const std::byte> view(const JsonFields& root, const JsonFields& field) {
    const std::size_t i = index(field, size_of(root, "bufferViews"));
    if (error_) return {};
    const JsonFields fields = member(root, "bufferViews", i);
    const std::size_t buffer = index(fields.at("buffer"), size_of(root, "buffers"));
    if (error_) return {};
    if (buffer != 0 || member(root, "buffers", 0).has("uri")) {
      refuse("the Gaussians lie in another file: export as one .glb", fields.where());
      return {};
    }
    const double offset = fields.has("byteOffset") ? fields.at("byteOffset").number() : 0.0;
    const double length = fields.at("byteLength").number();
    if (error_) return {};
    if (!(offset >= 0 && length >= 1 && offset == std::floor(offset) && length == std::floor(length) &&
          offset + length <= double(binary_.size()))) {
      fields.fail_here("the view lies outside of the " + std::to_string(binary_.size()) + " bytes of the buffer");
      return {};
    }
    return binary_.subspan(std::size_t(offset), std::size_t(length));
  }

  /// An attribute's values; empty, with error_ set, where something does not fit.
  Values values(const JsonFields& root, const JsonFields& attributes, const std::string& name,
                const std::string& type) {
    Values out;
    const std::size_t i = index(attributes.at(name.c_str()), size_of(root, "accessors"));
    if (error_) return out;
    const JsonFields accessor = member(root, "accessors", i);
    const std::string found = accessor.at("type").string();
    if (found != type && !(type == "VEC3" && name == "COLOR_0" && found == "VEC4")) {
      accessor.fail_here("expected values of type " + type + " for " + name);
      return out;
    }
    if (accessor.has("sparse")) refuse("a sparse accessor: export the values whole", accessor.where());
    out.channels = found == "SCALAR" ? 1 : found == "VEC3" ? 3 : 4;
    const double component = accessor.at("componentType").number(), count = accessor.at("count").number();
    const double offset = accessor.has("byteOffset") ? accessor.at("byteOffset").number() : 0.0;
    out.normalized = accessor.has("normalized") && accessor.at("normalized").boolean();
    if (error_) return out;
    const bool known = component == signed_byte || component == unsigned_byte || component == signed_short ||
                       component == unsigned_short || component == float32;
    if (!known || !(count >= 1 && count <= 4294967295.0 && count == std::floor(count)) ||
        !(offset >= 0 && offset <= 4294967295.0 && offset == std::floor(offset))) {
      accessor.fail_here("expected a count from 1, an offset from 0, and components of a known type");
      return out;
    }
    out.type = std::uint32_t(component), out.count = std::uint64_t(count);
    const auto bytes = view(root, accessor.at("bufferView"));
    if (error_) return out;
    const JsonFields owner =
        member(root, "bufferViews", index(accessor.at("bufferView"), size_of(root, "bufferViews")));
    const std::size_t element = out.channels * Values::size_of(out.type);
    const double stride = owner.has("byteStride") ? owner.at("byteStride").number() : double(element);
    if (error_) return out;
    // A stride of less than an element would let few bytes pretend to be many Gaussians.
    if (!(stride >= double(element) && stride <= 252 && stride == std::floor(stride)) ||
        std::uint64_t(offset) + (out.count - 1) * std::uint64_t(stride) + element > bytes.size()) {
      accessor.fail_here(std::to_string(out.count) + " values do not fit into their view of " +
                         std::to_string(bytes.size()) + " bytes");
      return out;
    }
    out.stride = std::size_t(stride);
    out.bytes = bytes.subspan(std::size_t(offset));
    return out;
  }

  /// A part's Gaussians, where their node puts them.
  Result<scene::GaussianCloud> spz_part(const Splats& splats) {
    auto part = decode_spz(splats.spz, spz_name(), options_);
    if (!part) return propagate(part);
    scene::GaussianCloud& cloud = part->cloud;
    if (cloud.size() != splats.count || cloud.sh_degree != splats.sh_degree)
      return damaged("its SPZ part contradicts itself", file_);
    antialiased_ = antialiased_ || part->origin.antialiased;
    if (!part->origin.spz_extensions.empty()) leave_out("extensions of SPZ parts");
    for (std::string& left_out : part->origin.left_out) leave_out("in an SPZ part, " + std::move(left_out));
    const Mover mover(splats.placement, true);
    parallel_for(cloud.size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) mover.apply(cloud, i);
    });
    return std::move(cloud);
  }
  [[nodiscard]] std::string spz_name() const { return file_ + ":spz"; }

  Result<void> copy_spz_part(const Splats& splats, scene::GaussianCloud& cloud, std::size_t first) {
    const auto lent = take_from(options_.memory, splats.count * cloud_row_bytes(splats.sh_degree), spz_name());
    if (!lent) return propagate(lent);
    const auto part = spz_part(splats);
    if (!part) return propagate(part);
    const std::size_t in = scene::sh_coefficients(splats.sh_degree), out = scene::sh_coefficients(cloud.sh_degree);
    parallel_for(part->size(), rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::size_t to = first + i;
        cloud.mean.set(to, part->mean.get(i));
        cloud.log_scale.set(to, part->log_scale.get(i));
        cloud.rotation.set(to, part->rotation.get(i));
        cloud.opacity_logit[to] = part->opacity_logit[i];
        for (std::size_t c = 0; c < 3; ++c)
          std::copy_n(part->sh_row(i).begin() + std::ptrdiff_t(c * in), in,
                      cloud.sh_row(to).begin() + std::ptrdiff_t(c * out));
      }
    });
    return {};
  }

  /// Puts rows where their node has them, in right, down, front.
  class Mover {
   public:
    /// in_rdf  the rows already are in that frame, though their node is not
    Mover(const Placement& placement, bool in_rdf)
        : scale_(scale_of(placement)),
          turn_(rdf_from(axes) * orthogonal(placement) * (in_rdf ? glm::transpose(rdf_from(axes)) : DMat3(1.0))),
          shift_(rdf_from(axes) * placement.shift) {}

    void apply(scene::GaussianCloud& cloud, std::size_t row) const {
      turn_.apply(cloud, row);
      if (scale_ == 1 && shift_ == DVec3(0.0)) return;
      cloud.mean.set(row, Vec3(scale_ * DVec3(cloud.mean.get(row)) + shift_));
      const auto log = float(std::log(scale_));
      cloud.log_scale.set(row, cloud.log_scale.get(row) + Vec3(log));
    }

   private:
    /// To the bit where the node changes nothing or only signs, and else made orthogonal again after its division.
    static DMat3 orthogonal(const Placement& placement) {
      DMat3 m = placement.linear * (1.0 / scale_of(placement));
      bool signs = true;
      for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) signs = signs && std::abs(m[c][r] - (c == r ? std::round(m[c][r]) : 0.0)) < 1e-15;
      if (signs) {
        for (int c = 0; c < 3; ++c)
          for (int r = 0; r < 3; ++r) m[c][r] = std::round(m[c][r]);
        return m;
      }
      const double side = glm::determinant(m) < 0 ? -1.0 : 1.0;
      return glm::mat3_cast(glm::normalize(glm::quat_cast(m * side))) * side;
    }

    double scale_;
    Turn turn_;
    DVec3 shift_;
  };

  Result<void> decode_attributes(const Splats& splats, scene::GaussianCloud& cloud, std::size_t first) {
    const JsonFields root(tree_, file_ + ":", error_);
    const JsonFields attributes = attributes_of(root, splats);
    const Values position = values(root, attributes, "POSITION", "VEC3");
    const Values rotation = values(root, attributes, attribute("ROTATION"), "VEC4");
    const Values scale = values(root, attributes, attribute("SCALE"), "VEC3");
    // Early drafts had the opacity and the colour of degree 0 in COLOR_0 alone.
    const bool has_opacity = attributes.has(attribute("OPACITY").c_str()),
               has_dc = attributes.has(sh_name(0, 0).c_str());
    const Values opacity = has_opacity ? values(root, attributes, attribute("OPACITY"), "SCALAR")
                                       : values(root, attributes, "COLOR_0", "VEC4");
    std::vector<Values> sh{has_dc ? values(root, attributes, sh_name(0, 0), "VEC3")
                                  : values(root, attributes, "COLOR_0", "VEC3")};
    for (int degree = 1; degree <= splats.sh_degree; ++degree)
      for (int k = 0; k < 2 * degree + 1; ++k) sh.push_back(values(root, attributes, sh_name(degree, k), "VEC3"));
    for (const Values* all : {&position, &rotation, &scale, &opacity})
      if (!error_ && all->count != splats.count) attributes.fail_here("the attributes differ in count");
    for (const Values& all : sh)
      if (!error_ && all.count != splats.count) attributes.fail_here("the attributes differ in count");
    if (error_) return tl::make_unexpected(*error_);

    const std::size_t opacity_channel = has_opacity ? 0 : 3;
    for (std::size_t i = 0; i < splats.count; ++i)
      if (const float p = opacity.at(i, opacity_channel); !(p >= 0 && p <= 1))
        return fail(ErrorCode::corrupt_data, "an opacity is not between 0 and 1",
                    file_ + ":vertex[" + std::to_string(first + i) + "].opacity");
    const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
    const Mover mover(splats.placement, false);
    parallel_for(std::size_t(splats.count), rows_per_task, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::size_t to = first + i;
        const auto vector = [&](const Values& from) { return Vec3(from.at(i, 0), from.at(i, 1), from.at(i, 2)); };
        cloud.mean.set(to, vector(position));
        Vec3 size = vector(scale);
        if (!logarithmic_)
          for (int c = 0; c < 3; ++c)
            size[c] = size[c] == 0 ? -most_log_scale : float(std::log(double(size[c])));  // NaN stays
        cloud.log_scale.set(to, size);
        const Quat q(rotation.at(i, 3), rotation.at(i, 0), rotation.at(i, 1), rotation.at(i, 2));
        cloud.rotation.set(to, glm::dot(q, q) == 0 ? Quat(1, 0, 0, 0) : q);
        cloud.opacity_logit[to] = logit_of(opacity.at(i, opacity_channel));
        for (std::size_t k = 0; k < sh.size(); ++k)
          for (std::size_t c = 0; c < 3; ++c) {
            const float value = sh[k].at(i, c);
            cloud.sh_row(to)[c * coefficients + k] = k == 0 && !has_dc ? float((double(value) - 0.5) / sh_c0) : value;
          }
        mover.apply(cloud, to);
      }
    });
    return {};
  }

  /// Finite at both ends: where a float's sigmoid is 1, and where the engine saturates.
  static float logit_of(float opacity) {
    constexpr float logit_of_one = 17.5f, least = -30.0f;
    if (opacity >= 1) return logit_of_one;
    return opacity > 0 ? std::max(float(scene::logit(double(opacity))), least) : least;
  }

  std::span<const std::byte> bytes_, binary_;
  std::string file_;
  const ReadOptions& options_;
  MemoryBudget::Share tree_memory_;
  json tree_;
  std::optional<Error> error_;
  std::vector<Splats> splats_;
  std::vector<std::string> left_out_;
  bool antialiased_ = false;    ///< Does an SPZ part say so?
  bool logarithmic_ = false;    ///< Are SCALE the logarithms of scales?
  std::size_t primitives_ = 0;  ///< Of all nodes, of whatever kind.
  std::uint64_t count_ = 0;
  int sh_degree_ = 0;
};

/// One attribute of the file that is written.
struct Attribute {
  std::string name;
  std::size_t channels = 0;
  bool bytes = false;  ///< Normalised bytes instead of floats.
  std::size_t offset = 0;

  [[nodiscard]] std::size_t row_bytes() const { return channels * (bytes ? 1 : sizeof(float)); }
};

std::vector<Attribute> written_attributes(int sh_degree) {
  std::vector<Attribute> all{{"POSITION", 3},
                             {"COLOR_0", 4, true},
                             {attribute("ROTATION"), 4},
                             {attribute("SCALE"), 3},
                             {attribute("OPACITY"), 1}};
  for (int degree = 0; degree <= sh_degree; ++degree)
    for (int k = 0; k < 2 * degree + 1; ++k) all.push_back({sh_name(degree, k), 3});
  return all;
}

/// Of unit length; one that is so to rounding stays as it is, so that a file that was read gives the same bytes again.
Quat unit(Quat q) {
  const double square = glm::dot(DQuat(q), DQuat(q));
  if (square == 0) return {1, 0, 0, 0};
  return std::abs(square - 1) < 1e-6 ? q : Quat(glm::normalize(DQuat(q)));
}

json document(const scene::GaussianCloud& cloud, const std::vector<Attribute>& attributes, std::size_t bytes, Vec3 low,
              Vec3 high) {
  json views = json::array(), accessors = json::array(), names = json::object();
  for (const Attribute& a : attributes) {
    constexpr int array_buffer = 34962;
    views.push_back({{"buffer", 0},
                     {"byteOffset", a.offset},
                     {"byteLength", cloud.size() * a.row_bytes()},
                     {"target", array_buffer}});
    json accessor = {{"bufferView", accessors.size()},
                     {"componentType", a.bytes ? unsigned_byte : float32},
                     {"count", cloud.size()},
                     {"type", a.channels == 1   ? "SCALAR"
                              : a.channels == 3 ? "VEC3"
                                                : "VEC4"}};
    if (a.bytes) accessor["normalized"] = true;
    if (a.name == "POSITION") {
      accessor["min"] = json::array({low.x, low.y, low.z});
      accessor["max"] = json::array({high.x, high.y, high.z});
    }
    names[a.name] = accessors.size();
    accessors.push_back(std::move(accessor));
  }
  json primitive = {{"attributes", names}, {"mode", points_mode}};
  primitive["extensions"][extension] = {{"kernel", "ellipse"},
                                        {"colorSpace", "srgb_rec709_display"},
                                        {"sortingMethod", "cameraDistance"},
                                        {"projection", "perspective"}};
  json root;
  root["asset"] = {{"version", "2.0"}, {"generator", "splatdrag"}};
  root["extensionsUsed"] = json::array({extension});
  root["scene"] = 0;
  root["scenes"] = json::array({{{"nodes", json::array({0})}}});
  root["nodes"] = json::array({{{"mesh", 0}}});
  root["meshes"] = json::array({{{"primitives", json::array({primitive})}}});
  root["buffers"] = json::array({{{"byteLength", bytes}}});
  root["bufferViews"] = views;
  root["accessors"] = accessors;
  return root;
}

}  // namespace

bool looks_like_glb(std::span<const std::byte> bytes) {
  constexpr std::string_view mark = "glTF";
  return bytes.size() >= mark.size() && std::memcmp(bytes.data(), mark.data(), mark.size()) == 0;
}

std::uint64_t expected_glb_bytes(std::span<const std::byte> bytes, const ReadOptions& options) {
  const auto expected = within_memory("", [&]() -> Result<std::uint64_t> {
    Glb glb(bytes, "", options);
    if (auto done = glb.survey(); !done) return propagate(done);
    return glb.count() * cloud_row_bytes(glb.sh_degree());
  });
  return std::max<std::uint64_t>(bytes.size(), expected.value_or(0));
}

Result<DecodedScene> decode_glb(std::span<const std::byte> bytes, const std::string& file, const ReadOptions& options) {
  return Glb(bytes, file, options).decode();
}

Result<std::vector<std::byte>> encode_glb(const scene::GaussianCloud& cloud, const std::string& file) {
  auto attributes = written_attributes(cloud.sh_degree);
  const std::size_t n = cloud.size();
  std::size_t bytes = 0;
  for (Attribute& a : attributes) {
    a.offset = bytes;
    bytes += n * a.row_bytes();  // a multiple of 4, as glTF wants it
  }
  constexpr std::uint64_t most = 0xffffffffu - (std::uint64_t{1} << 20);  // of the container, less the JSON
  if (bytes > most)
    return fail(ErrorCode::too_large, "a .glb file holds at most 4 GiB: write an .spz or .ply file", file);
  std::vector<std::byte> binary(bytes);
  const auto put = [&](const Attribute& a, std::size_t row, std::size_t channel, float value) {
    std::memcpy(binary.data() + a.offset + row * a.row_bytes() + channel * sizeof value, &value, sizeof value);
  };
  const Turn from_rdf(glm::transpose(rdf_from(axes)));
  const std::size_t coefficients = scene::sh_coefficients(cloud.sh_degree);
  parallel_for(n, rows_per_task, [&](std::size_t begin, std::size_t end) {
    std::vector<std::uint32_t> rows;
    for (std::size_t i = begin; i < end; ++i) rows.push_back(std::uint32_t(i));
    scene::GaussianCloud turned = scene::gather(cloud, rows);
    for (std::size_t k = 0; k < turned.size(); ++k) {
      const std::size_t i = begin + k;
      from_rdf.apply(turned, k);
      const auto sh = turned.sh_row(k);
      const Quat q = unit(turned.rotation.get(k));
      const auto opacity = float(1.0 / (1.0 + std::exp(-double(std::clamp(turned.opacity_logit[k], -80.0f, 80.0f)))));
      const std::array<float, 4> rotation{q.x, q.y, q.z, q.w};
      for (std::size_t c = 0; c < 4; ++c) put(attributes[2], i, c, rotation[c]);
      for (std::size_t c = 0; c < 3; ++c) {
        put(attributes[0], i, c, turned.mean.get(k)[int(c)]);
        // Saturated where the renderer saturates, so that no scale is infinite.
        put(attributes[3], i, c,
            float(std::exp(double(std::clamp(turned.log_scale.get(k)[int(c)], -most_log_scale, most_log_scale)))));
        for (std::size_t j = 0; j < coefficients; ++j) put(attributes[5 + j], i, c, sh[c * coefficients + j]);
        binary[attributes[1].offset + 4 * i + c] =
            std::byte(nearest_byte(255 * (0.5 + sh_c0 * double(sh[c * coefficients]))));
      }
      put(attributes[4], i, 0, opacity);
      binary[attributes[1].offset + 4 * i + 3] = std::byte(nearest_byte(255 * double(opacity)));
    }
  });
  Vec3 low(std::numeric_limits<float>::max()), high(-low);
  const auto* const positions = binary.data() + attributes[0].offset;
  for (std::size_t i = 0; i < n; ++i) {
    Vec3 at;
    std::memcpy(&at.x, positions + 12 * i, sizeof(float)), std::memcpy(&at.y, positions + 12 * i + 4, sizeof(float)),
        std::memcpy(&at.z, positions + 12 * i + 8, sizeof(float));
    low = glm::min(low, at), high = glm::max(high, at);
  }
  std::string text = document(cloud, attributes, bytes, low, high).dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  constexpr std::size_t heads = 12 + 8 + 8;
  ByteWriter out;
  out.write(magic), out.write(std::uint32_t{2}), out.write(std::uint32_t(heads + text.size() + bytes));
  out.write(std::uint32_t(text.size())), out.write(json_chunk), out.write_all(std::span<const char>(text));
  out.write(std::uint32_t(bytes)), out.write(binary_chunk), out.write_all(std::span<const std::byte>(binary));
  const auto whole = out.bytes();
  return std::vector<std::byte>(whole.begin(), whole.end());
}

}  // namespace engine::io
