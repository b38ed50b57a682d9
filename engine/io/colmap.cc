#include "engine/io/colmap.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>

#include "engine/core/byte_reader.h"

namespace engine::io {
namespace {

/// `layout` spells the parameters in file order: f is one focal length for both axes, F and G are fx and fy, x and y
/// the principal point, 1 to 4 are k1 to k4, p and q are p1 and p2.
struct CameraModel {
  std::string_view name;
  LensModel lens = LensModel::perspective;
  std::string_view layout;  ///< Empty: known by name only.
};

/// In the order of COLMAP's model ids.
constexpr CameraModel camera_models[] = {
    {"SIMPLE_PINHOLE", LensModel::perspective, "fxy"},     {"PINHOLE", LensModel::perspective, "FGxy"},
    {"SIMPLE_RADIAL", LensModel::perspective, "fxy1"},     {"RADIAL", LensModel::perspective, "fxy12"},
    {"OPENCV", LensModel::perspective, "FGxy12pq"},        {"OPENCV_FISHEYE", LensModel::fisheye, "FGxy1234"},
    {"FULL_OPENCV", LensModel::perspective, ""},           {"FOV", LensModel::perspective, ""},
    {"SIMPLE_RADIAL_FISHEYE", LensModel::fisheye, "fxy1"}, {"RADIAL_FISHEYE", LensModel::fisheye, "fxy12"},
    {"THIN_PRISM_FISHEYE", LensModel::fisheye, ""},
};

void set_parameter(Lens& lens, char what, double value) {
  switch (what) {
    case 'f':
      lens.fx = lens.fy = value;
      break;
    case 'F':
      lens.fx = value;
      break;
    case 'G':
      lens.fy = value;
      break;
    case 'x':
      lens.cx = value;
      break;
    case 'y':
      lens.cy = value;
      break;
    case 'p':
      lens.p[0] = value;
      break;
    case 'q':
      lens.p[1] = value;
      break;
    default:
      lens.k[std::size_t(what - '1')] = value;
  }
}

std::string element(const std::string& file, const char* kind, std::size_t index) {
  return file + ":" + kind + "[" + std::to_string(index) + "]";
}

tl::unexpected<Error> corrupt(std::string message, std::string where) {
  return fail(ErrorCode::corrupt_data, std::move(message), std::move(where));
}

tl::unexpected<Error> ends_early(std::string where) {
  return corrupt("the file ends before this entry is complete: copy it again", std::move(where));
}

Result<const CameraModel*> supported(const CameraModel* model, const std::string& found, const std::string& where) {
  if (model != nullptr && !model->layout.empty()) return model;
  return fail(ErrorCode::unsupported,
              "camera model " + found + " is not supported: undistort with `colmap image_undistorter`",
              where + ".model");
}

constexpr const char* q_names[] = {"qw", "qx", "qy", "qz"};
constexpr const char* t_names[] = {"tx", "ty", "tz"};
constexpr const char* axes[] = {"x", "y", "z"};

/// Fields of one entry as both encodings have them.
struct RawImage {
  double q[4]{}, t[3]{};
  std::uint32_t camera_id = 0;
  std::string name;
};

Result<Shot> to_shot(const RawImage& image, const ColmapCameras& cameras, std::string where) {
  for (int i = 0; i < 4; ++i)
    if (!std::isfinite(image.q[i])) return corrupt("expected a finite number", where + "." + q_names[i]);
  for (int i = 0; i < 3; ++i)
    if (!std::isfinite(image.t[i])) return corrupt("expected a finite number", where + "." + t_names[i]);
  // Written quaternions have length 1 but for rounding. Far from that the numbers are no rotation at all, and the
  // squares of the length could underflow or overflow.
  const DQuat q(image.q[0], image.q[1], image.q[2], image.q[3]);
  const double length = glm::length(q);
  if (!(length > 1e-6 && length < 1e6))
    return corrupt("expected a quaternion of length 1, found length " + std::to_string(length), where + ".qw");
  const auto camera = cameras.find(image.camera_id);
  if (camera == cameras.end())
    return corrupt("there is no camera " + std::to_string(image.camera_id) + " among the " +
                       std::to_string(cameras.size()) + " of this model",
                   where + ".camera_id");
  if (image.name.empty()) return corrupt("expected the file name of a photo, found nothing", where + ".name");
  Shot shot;
  shot.name = image.name;
  shot.rotation = glm::mat3_cast(q / length);
  shot.translation = {image.t[0], image.t[1], image.t[2]};
  shot.lens = camera->second;
  shot.where = std::move(where);
  return shot;
}

Result<void> add_camera(ColmapCameras& cameras, std::uint32_t id, const Lens& lens, const std::string& where) {
  if (cameras.emplace(id, lens).second) return {};
  return corrupt("camera " + std::to_string(id) + " is described twice", where + ".camera_id");
}

/// Pictures have sides of up to 2^31 pixels as far as the file is concerned; validate(Camera) is stricter.
Result<int> side(std::uint64_t pixels, std::string where) {
  if (pixels >= 1 && pixels <= 0x7fffffff) return int(pixels);
  return corrupt("expected a number of pixels, found " + std::to_string(pixels), std::move(where));
}

Result<Lens> to_lens(const CameraModel& model, std::uint64_t width, std::uint64_t height,
                     const std::vector<double>& parameters, const std::string& where) {
  Lens lens;
  lens.model = model.lens;
  const auto w = side(width, where + ".width"), h = side(height, where + ".height");
  if (!w) return propagate(w);
  if (!h) return propagate(h);
  lens.width = *w, lens.height = *h;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!std::isfinite(parameters[i]))
      return corrupt("expected a finite number", where + ".params[" + std::to_string(i) + "]");
    set_parameter(lens, model.layout[i], parameters[i]);
  }
  return lens;
}

Result<std::size_t> count_of(ByteReader& reader, std::uint64_t least_size, const std::string& file) {
  const auto count = reader.read<std::uint64_t>();
  if (!reader.ok()) return ends_early(file + ":count");
  if (!reader.has(count, least_size))
    return corrupt("the file states " + std::to_string(count) + " entries and ends after " +
                       std::to_string(reader.remaining()) + " more bytes",
                   file + ":count");
  return std::size_t(count);
}

Result<void> at_end(const ByteReader& reader, const std::string& file) {
  if (reader.remaining() == 0) return {};
  return corrupt(std::to_string(reader.remaining()) + " bytes follow the last entry", file);
}

Result<ColmapCameras> binary_cameras(std::span<const std::byte> bytes, const std::string& file) {
  ByteReader reader(bytes);
  const auto count = count_of(reader, 48, file);
  if (!count) return propagate(count);
  ColmapCameras cameras;
  for (std::size_t i = 0; i < *count; ++i) {
    const std::string where = element(file, "camera", i);
    const auto id = reader.read<std::uint32_t>();
    const auto model_id = reader.read<std::int32_t>();
    const auto width = reader.read<std::uint64_t>(), height = reader.read<std::uint64_t>();
    if (!reader.ok()) return ends_early(where);
    const bool known = model_id >= 0 && std::size_t(model_id) < std::size(camera_models);
    const CameraModel* entry = known ? &camera_models[model_id] : nullptr;
    const auto model = supported(entry, known ? std::string(entry->name) : std::to_string(model_id), where);
    if (!model) return propagate(model);
    std::vector<double> parameters((*model)->layout.size());
    for (double& parameter : parameters) parameter = reader.read<double>();
    if (!reader.ok()) return ends_early(where);
    const auto lens = to_lens(**model, width, height, parameters, where);
    if (!lens) return propagate(lens);
    if (auto added = add_camera(cameras, id, *lens, where); !added) return propagate(added);
  }
  if (auto end = at_end(reader, file); !end) return propagate(end);
  return cameras;
}

Result<std::vector<Shot>> binary_images(std::span<const std::byte> bytes, const std::string& file,
                                        const ColmapCameras& cameras) {
  ByteReader reader(bytes);
  const auto count = count_of(reader, 73, file);
  if (!count) return propagate(count);
  std::vector<Shot> shots;
  for (std::size_t i = 0; i < *count; ++i) {
    std::string where = element(file, "image", i);
    RawImage image;
    (void)reader.read<std::uint32_t>();  // image_id: views are known by name
    for (double& value : image.q) value = reader.read<double>();
    for (double& value : image.t) value = reader.read<double>();
    image.camera_id = reader.read<std::uint32_t>();
    image.name = reader.read_c_string();
    const auto points = reader.read<std::uint64_t>();
    (void)reader.take(points, 24);  // x, y, point3D_id
    if (!reader.ok()) return ends_early(std::move(where));
    auto shot = to_shot(image, cameras, std::move(where));
    if (!shot) return propagate(shot);
    shots.push_back(std::move(*shot));
  }
  if (auto end = at_end(reader, file); !end) return propagate(end);
  return shots;
}

Result<std::vector<Point>> binary_points(std::span<const std::byte> bytes, const std::string& file) {
  ByteReader reader(bytes);
  const auto count = count_of(reader, 51, file);
  if (!count) return propagate(count);
  std::vector<Point> points(*count);
  for (std::size_t i = 0; i < *count; ++i) {
    Point& point = points[i];
    (void)reader.read<std::uint64_t>();  // point3D_id
    for (int axis = 0; axis < 3; ++axis) point.position[axis] = reader.read<double>();
    for (auto& channel : point.rgb) channel = reader.read<std::uint8_t>();
    (void)reader.read<double>();  // reprojection error
    const auto track = reader.read<std::uint64_t>();
    (void)reader.take(track, 8);  // image_id, point2D_idx
    if (!reader.ok()) return ends_early(element(file, "point", i));
    for (int axis = 0; axis < 3; ++axis)
      if (!std::isfinite(point.position[axis]))
        return corrupt("expected a finite number", element(file, "point", i) + "." + axes[axis]);
  }
  if (auto end = at_end(reader, file); !end) return propagate(end);
  return points;
}

/// The words of one line of a text file. The first word that is missing or not what was asked for becomes the error.
class Words {
 public:
  Words(std::string_view line, std::string where) : rest_(line), where_(std::move(where)) {}

  [[nodiscard]] const std::string& where() const { return where_; }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

  [[nodiscard]] std::string_view word(const char* field) {
    skip_blanks();
    const auto length = std::min(rest_.find_first_of(" \t"), rest_.size());
    const auto found = rest_.substr(0, length);
    rest_.remove_prefix(length);
    if (found.empty()) note("the line ends before this field", field);
    return found;
  }

  template <Scalar T>
  [[nodiscard]] T number(const char* field) {
    T value{};
    const auto text = word(field);
    const auto [end, status] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (status != std::errc() || end != text.data() + text.size())
      note("expected a number, found `" + std::string(text.substr(0, 40)) + "`", field);
    return value;
  }

  /// What is left of the line, blanks within it included.
  [[nodiscard]] std::string rest() {
    skip_blanks();
    return std::string(std::exchange(rest_, {}));
  }
  [[nodiscard]] bool at_end() {
    skip_blanks();
    return rest_.empty();
  }

 private:
  void skip_blanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }
  void note(std::string message, const char* field) {
    if (!error_) error_ = Error{ErrorCode::corrupt_data, std::move(message), where_ + "." + field};
  }

  std::string_view rest_;
  std::string where_;
  std::optional<Error> error_;
};

class Lines {
 public:
  explicit Lines(std::span<const std::byte> bytes) : rest_(reinterpret_cast<const char*>(bytes.data()), bytes.size()) {}

  /// The next line without its end (LF or CRLF), whatever it holds; nothing at the end of the file.
  [[nodiscard]] std::optional<std::string_view> next() {
    if (rest_.empty()) return std::nullopt;
    const auto length = std::min(rest_.find('\n'), rest_.size());
    auto line = rest_.substr(0, length);
    rest_.remove_prefix(std::min(length + 1, rest_.size()));
    ++number_;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ' || line.back() == '\t')) line.remove_suffix(1);
    return line;
  }
  /// The next line that is neither empty nor a comment.
  [[nodiscard]] std::optional<std::string_view> next_entry() {
    auto line = next();
    while (line && (line->empty() || line->front() == '#')) line = next();
    return line;
  }
  /// Of the line that was returned last, from 1.
  [[nodiscard]] std::size_t number() const { return number_; }

 private:
  std::string_view rest_;
  std::size_t number_ = 0;
};

Result<ColmapCameras> text_cameras(std::span<const std::byte> bytes, const std::string& file) {
  ColmapCameras cameras;
  Lines lines(bytes);
  while (const auto line = lines.next_entry()) {
    Words words(*line, element(file, "line", lines.number()));
    const auto id = words.number<std::uint32_t>("camera_id");
    const auto name = words.word("model");
    if (words.error()) return tl::make_unexpected(*words.error());
    const auto found = std::find_if(std::begin(camera_models), std::end(camera_models),
                                    [&](const CameraModel& model) { return model.name == name; });
    const auto model =
        supported(found == std::end(camera_models) ? nullptr : found, std::string(name.substr(0, 40)), words.where());
    if (!model) return propagate(model);
    const auto width = words.number<std::uint64_t>("width"), height = words.number<std::uint64_t>("height");
    std::vector<double> parameters((*model)->layout.size());
    for (double& parameter : parameters) parameter = words.number<double>("params");
    if (words.error()) return tl::make_unexpected(*words.error());
    if (!words.at_end())
      return corrupt(
          "expected " + std::to_string(parameters.size()) + " parameters for " + std::string(name) + ", found more",
          words.where() + ".params");
    const auto lens = to_lens(**model, width, height, parameters, words.where());
    if (!lens) return propagate(lens);
    if (auto added = add_camera(cameras, id, *lens, words.where()); !added) return propagate(added);
  }
  return cameras;
}

Result<std::vector<Shot>> text_images(std::span<const std::byte> bytes, const std::string& file,
                                      const ColmapCameras& cameras) {
  std::vector<Shot> shots;
  Lines lines(bytes);
  while (const auto line = lines.next_entry()) {
    Words words(*line, element(file, "line", lines.number()));
    RawImage image;
    (void)words.number<std::uint32_t>("image_id");
    for (int i = 0; i < 4; ++i) image.q[i] = words.number<double>(q_names[i]);
    for (int i = 0; i < 3; ++i) image.t[i] = words.number<double>(t_names[i]);
    image.camera_id = words.number<std::uint32_t>("camera_id");
    image.name = words.rest();
    if (words.error()) return tl::make_unexpected(*words.error());
    auto shot = to_shot(image, cameras, words.where());
    if (!shot) return propagate(shot);
    shots.push_back(std::move(*shot));
    (void)lines.next();  // its 2D points: a line of their own, which may be empty or, at the end of the file, absent
  }
  return shots;
}

Result<std::vector<Point>> text_points(std::span<const std::byte> bytes, const std::string& file) {
  std::vector<Point> points;
  Lines lines(bytes);
  while (const auto line = lines.next_entry()) {
    Words words(*line, element(file, "line", lines.number()));
    Point point;
    (void)words.number<std::uint64_t>("point3D_id");
    constexpr const char* channels[] = {"r", "g", "b"};
    for (int i = 0; i < 3; ++i) point.position[i] = words.number<double>(axes[i]);
    for (std::size_t i = 0; i < 3; ++i) point.rgb[i] = words.number<std::uint8_t>(channels[i]);
    if (words.error()) return tl::make_unexpected(*words.error());
    for (int i = 0; i < 3; ++i)
      if (!std::isfinite(point.position[i])) return corrupt("expected a finite number", words.where() + "." + axes[i]);
    points.push_back(point);
  }
  return points;
}

}  // namespace

Result<ColmapCameras> parse_colmap_cameras(std::span<const std::byte> bytes, ColmapEncoding encoding,
                                           const std::string& file) {
  return encoding == ColmapEncoding::binary ? binary_cameras(bytes, file) : text_cameras(bytes, file);
}

Result<std::vector<Shot>> parse_colmap_images(std::span<const std::byte> bytes, ColmapEncoding encoding,
                                              const std::string& file, const ColmapCameras& cameras) {
  return encoding == ColmapEncoding::binary ? binary_images(bytes, file, cameras) : text_images(bytes, file, cameras);
}

Result<std::vector<Point>> parse_colmap_points(std::span<const std::byte> bytes, ColmapEncoding encoding,
                                               const std::string& file) {
  return encoding == ColmapEncoding::binary ? binary_points(bytes, file) : text_points(bytes, file);
}

}  // namespace engine::io
