#include "server/scenes/catalogue/manifest.h"

#include <algorithm>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>

#include "engine/core/atomic_file.h"
#include "engine/io/read_bytes.h"
#include "server/scenes/disk/digest.h"

namespace server::scenes {
namespace {

using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using nlohmann::json;
using nlohmann::ordered_json;

constexpr int manifest_format = 5;  // format number of scene.json
constexpr int most_versions = 1'000'000'000;
constexpr int first_with_digests = 2;  // a format before has none
constexpr int first_with_gaps = 3;     // before, no version was ever deleted
constexpr int first_with_names = 4;    // of versions
constexpr int first_with_uploaders = 5;
/// A larger file is refused before it is read: a hundred thousand versions come to less. A choice.
constexpr std::uint64_t max_manifest_bytes = std::uint64_t{64} << 20;

/// What stands before the digest of the manifest itself, which is that of all before.
constexpr std::string_view before_own_digest = ",\n  \"xxh3\": \"";

/// The first thing wrong with a manifest. Thrown and caught in this file only: a manifest has dozens of fields, none of
/// which can be done without.
struct Wrong {
  std::string what, where;
};

/// An object of the file, whose every member has to be read.
class Object {
 public:
  Object(const json& value, std::string where, std::initializer_list<std::string_view> names)
      : value_(value), where_(std::move(where)) {
    if (!value.is_object()) throw Wrong{"expected an object", where_};
    for (const auto& member : value.items())
      if (std::find(names.begin(), names.end(), member.key()) == names.end())
        throw Wrong{"unknown field; was this written by a newer version?", address(member.key())};
  }

  [[nodiscard]] const json& any(std::string_view name) const {
    const auto member = value_.find(name);
    if (member == value_.end()) throw Wrong{"the field is missing", address(name)};
    return *member;
  }
  [[nodiscard]] std::string text(std::string_view name) const {
    if (!any(name).is_string()) throw Wrong{"expected a string", address(name)};
    return any(name).get<std::string>();
  }
  /// A file's name or a relative path that stays where it is.
  [[nodiscard]] std::filesystem::path relative(std::string_view name) const {
    const std::filesystem::path path = text(name);
    const bool leaves = path.is_absolute() || std::find(path.begin(), path.end(), "..") != path.end();
    if (path.empty() || leaves) throw Wrong{"expected a path within the folder", address(name)};
    return path;
  }
  [[nodiscard]] std::uint64_t count(std::string_view name) const {
    if (!any(name).is_number_unsigned()) throw Wrong{"expected a whole number from 0 up", address(name)};
    return any(name).get<std::uint64_t>();
  }
  [[nodiscard]] int whole(std::string_view name, int low, int high) const {
    const std::uint64_t value = count(name);
    if (value < std::uint64_t(low) || value > std::uint64_t(high)) throw Wrong{"out of range", address(name)};
    return int(value);
  }
  [[nodiscard]] double number(std::string_view name) const { return number_at(any(name), address(name)); }
  [[nodiscard]] engine::DVec3 point(std::string_view name) const {
    const json& value = any(name);
    if (!value.is_array() || value.size() != 3) throw Wrong{"expected three numbers", address(name)};
    engine::DVec3 point{0.0};
    for (int i = 0; i < 3; ++i) point[i] = number_at(value[std::size_t(i)], address(name));
    return point;
  }
  [[nodiscard]] Time time(std::string_view name) const {
    if (!any(name).is_number_integer()) throw Wrong{"expected milliseconds since 1970", address(name)};
    return Time(std::chrono::milliseconds(any(name).get<std::int64_t>()));
  }
  [[nodiscard]] bool boolean(std::string_view name) const {
    if (!any(name).is_boolean()) throw Wrong{"expected true or false", address(name)};
    return any(name).get<bool>();
  }
  [[nodiscard]] const json& array(std::string_view name) const {
    if (!any(name).is_array()) throw Wrong{"expected an array", address(name)};
    return any(name);
  }
  /// A digest, or "" for null: none was noted.
  [[nodiscard]] std::string digest(std::string_view name) const {
    if (any(name).is_null()) return {};
    if (!is_digest(text(name))) throw Wrong{"expected 16 hexadecimal digits", address(name)};
    return text(name);
  }
  /// What `read` makes of a member that may be null.
  template <class Read>
  [[nodiscard]] auto maybe(std::string_view name, Read read) const -> std::optional<decltype(read())> {
    if (any(name).is_null()) return std::nullopt;
    return read();
  }
  [[nodiscard]] std::string address(std::string_view name) const {
    return where_ + (where_.empty() ? "" : ".") + std::string(name);
  }

 private:
  static double number_at(const json& value, const std::string& where) {
    if (!value.is_number()) throw Wrong{"expected a number", where};
    return value.get<double>();
  }

  const json& value_;
  std::string where_;
};

ordered_json encoded(engine::DVec3 point) { return {point.x, point.y, point.z}; }
std::int64_t encoded(Time time) { return time.time_since_epoch().count(); }
ordered_json encoded_digest(const std::string& digest) {
  return digest.empty() ? ordered_json(nullptr) : ordered_json(digest);
}
template <class T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json encoded(const DatasetInfo& info, const DatasetLocation& location) {
  return {{"kind", info.kind},
          {"folder", location.folder},
          {"below_root", location.below_root},
          {"disk_bytes", location.disk_bytes},
          {"xxh3", encoded_digest(location.list_digest)},
          {"uploader", location.uploader},
          {"views", info.views},
          {"photos", info.photos},
          {"psnr_mean_db", or_null(info.psnr_mean_db)},
          {"psnr_worst_db", or_null(info.psnr_worst_db)},
          {"psnr_worst_view", info.psnr_worst_view},
          {"warnings", info.warnings}};
}

void read_dataset(const json& value, int format, Manifest& manifest) {
  const Object in(value, "dataset",
                  {"kind", "folder", "below_root", "disk_bytes", "xxh3", "uploader", "views", "photos", "psnr_mean_db",
                   "psnr_worst_db", "psnr_worst_view", "warnings"});
  DatasetInfo info;
  info.kind = in.text("kind");
  info.views = in.count("views"), info.photos = in.count("photos");
  info.psnr_mean_db = in.maybe("psnr_mean_db", [&] { return in.number("psnr_mean_db"); });
  info.psnr_worst_db = in.maybe("psnr_worst_db", [&] { return in.number("psnr_worst_db"); });
  info.psnr_worst_view = in.text("psnr_worst_view");
  for (const json& warning : in.array("warnings")) {
    if (!warning.is_string()) throw Wrong{"expected a string", in.address("warnings")};
    info.warnings.push_back(warning.get<std::string>());
  }
  manifest.dataset = DatasetLocation{in.relative("folder"), in.boolean("below_root"), in.count("disk_bytes"),
                                     format < first_with_digests ? "" : in.digest("xxh3"),
                                     format < first_with_uploaders ? "" : in.text("uploader")};
  manifest.scene.dataset = std::move(info);
}

ordered_json encoded(const VersionInfo& version, std::uint64_t memory_bytes, const std::string& digest) {
  return {{"version", version.version},
          {"parent", or_null(version.parent)},
          {"edit", version.edit},
          {"name", version.name},
          {"created", encoded(version.created)},
          {"gaussians", version.gaussians},
          {"disk_bytes", version.disk_bytes},
          {"memory_bytes", memory_bytes},
          {"xxh3", encoded_digest(digest)}};
}

void read_version(const json& value, int format, Manifest& manifest) {
  const auto& known = manifest.scene.versions;
  const std::size_t place = known.size();
  const int least = known.empty() ? 0 : known.back().version + 1;
  const bool may_be_later = place > 0 && format >= first_with_gaps;
  const Object in(value, "versions[" + std::to_string(place) + "]",
                  {"version", "parent", "edit", "name", "created", "gaussians", "disk_bytes", "memory_bytes", "xxh3"});
  VersionInfo version;
  version.version = in.whole("version", least, may_be_later ? most_versions : least);
  version.parent = in.maybe("parent", [&] { return in.whole("parent", 0, std::max(least - 1, 0)); });
  if (version.parent.has_value() != (place > 0)) throw Wrong{"only version 0 has no parent", in.address("parent")};
  if (version.parent && !place_of(manifest, *version.parent))
    throw Wrong{"there is no such version", in.address("parent")};
  version.edit = in.text("edit");
  if (format >= first_with_names) version.name = in.text("name");
  version.created = in.time("created");
  version.gaussians = in.count("gaussians");
  version.disk_bytes = in.count("disk_bytes");
  manifest.overlay_memory_bytes.push_back(in.count("memory_bytes"));
  manifest.overlay_digests.push_back(format < first_with_digests ? "" : in.digest("xxh3"));
  manifest.scene.versions.push_back(std::move(version));
}

/// Digest of what stands before the one that a manifest ends with; "" where none does.
std::string digest_before(std::string_view text) {
  const std::size_t end = text.rfind(before_own_digest);
  return end == std::string_view::npos ? std::string() : digest_of(text.substr(0, end));
}

Manifest decode(const json& document, std::string_view text) {
  const Object in(document, "", {"manifest",
                                 "id",
                                 "nonce",
                                 "name",
                                 "uploader",
                                 "created",
                                 "format",
                                 "base",
                                 "base_disk_bytes",
                                 "base_memory_bytes",
                                 "base_xxh3",
                                 "sh_degree",
                                 "low",
                                 "high",
                                 "centre",
                                 "radius",
                                 "up",
                                 "dataset",
                                 "next_dataset",
                                 "next_version",
                                 "versions",
                                 "xxh3"});
  const int format = in.whole("manifest", 1, manifest_format);
  Manifest manifest;
  SceneInfo& scene = manifest.scene;
  scene.id = in.text("id");
  manifest.nonce = in.text("nonce");
  scene.name = in.text("name");
  if (format >= first_with_uploaders) scene.uploader = in.text("uploader");
  scene.created = in.time("created");
  scene.format = in.text("format");
  manifest.base = in.relative("base");
  manifest.base_disk_bytes = in.count("base_disk_bytes");
  manifest.base_memory_bytes = in.count("base_memory_bytes");
  if (format >= first_with_digests) manifest.base_digest = in.digest("base_xxh3");
  scene.sh_degree = in.whole("sh_degree", 0, engine::scene::max_sh_degree);
  scene.low = in.point("low"), scene.high = in.point("high");
  scene.centre = in.point("centre");
  scene.radius = in.number("radius");
  scene.up = in.maybe("up", [&] { return in.point("up"); });
  if (!in.any("dataset").is_null()) read_dataset(in.any("dataset"), format, manifest);
  manifest.next_dataset = in.whole("next_dataset", 1, 1'000'000'000);
  for (const json& version : in.array("versions")) read_version(version, format, manifest);
  if (scene.versions.empty()) throw Wrong{"expected at least version 0", "versions"};
  const int next = scene.versions.back().version + 1;
  manifest.next_version = format < first_with_gaps ? next : in.whole("next_version", next, most_versions + 1);
  // A damaged number of the format must not leave the rest unchecked.
  if (format < first_with_digests && document.contains("xxh3"))
    throw Wrong{"the file is damaged: a manifest of this format has no checksum", "manifest"};
  // Last: of a field that makes no sense its name says more.
  if (format >= first_with_digests && (in.digest("xxh3").empty() || in.digest("xxh3") != digest_before(text)))
    throw Wrong{"the file is damaged: it does not have the checksum it was written with; put back a copy of it",
                "xxh3"};
  return manifest;
}

ordered_json encoded(const Manifest& manifest) {
  const SceneInfo& scene = manifest.scene;
  ordered_json out{{"manifest", manifest_format},
                   {"id", scene.id},
                   {"nonce", manifest.nonce},
                   {"name", scene.name},
                   {"uploader", scene.uploader},
                   {"created", encoded(scene.created)},
                   {"format", scene.format},
                   {"base", manifest.base},
                   {"base_disk_bytes", manifest.base_disk_bytes},
                   {"base_memory_bytes", manifest.base_memory_bytes},
                   {"base_xxh3", encoded_digest(manifest.base_digest)},
                   {"sh_degree", scene.sh_degree},
                   {"low", encoded(scene.low)},
                   {"high", encoded(scene.high)},
                   {"centre", encoded(scene.centre)},
                   {"radius", scene.radius},
                   {"up", scene.up ? encoded(*scene.up) : ordered_json(nullptr)},
                   {"dataset", nullptr},
                   {"next_dataset", manifest.next_dataset},
                   {"next_version", manifest.next_version}};
  if (scene.dataset) out["dataset"] = encoded(*scene.dataset, *manifest.dataset);
  ordered_json& versions = out["versions"] = ordered_json::array();
  for (std::size_t i = 0; i < scene.versions.size(); ++i)
    versions.push_back(encoded(scene.versions[i], manifest.overlay_memory_bytes[i], manifest.overlay_digests[i]));
  return out;
}

std::string text_of(const Manifest& manifest) {
  std::string text = encoded(manifest).dump(2, ' ', false, ordered_json::error_handler_t::replace);
  text.resize(text.size() - std::string_view("\n}").size());
  const std::string digest = digest_of(text);
  return text + std::string(before_own_digest) + digest + "\"\n}\n";
}

/// What `decode` makes of JSON text, or what is wrong with it.
///   file  its name, for the error's address
template <class Decode>
auto decoded(std::string_view text, const std::string& file, Decode decode) -> Result<decltype(decode(json()))> {
  try {
    return decode(json::parse(text));
  } catch (const Wrong& wrong) {
    return fail(ErrorCode::corrupt_data, wrong.what, file + ":" + wrong.where);
  } catch (const json::parse_error& failure) {
    return fail(ErrorCode::corrupt_data, "not valid JSON: it goes wrong at byte " + std::to_string(failure.byte), file);
  } catch (const json::exception&) {
    return fail(ErrorCode::corrupt_data, "not valid JSON: a number is too large to be represented", file);
  }
}

}  // namespace

std::string to_text(const MadeVersion& made) {
  ordered_json out = encoded(made.version, made.memory_bytes, made.digest);
  out["file"] = made.file;
  return out.dump();
}

Result<MadeVersion> parse_made_version(const std::string& text) {
  return decoded(text, "result", [](const json& document) {
    const Object in(
        document, "",
        {"version", "parent", "edit", "name", "created", "gaussians", "disk_bytes", "memory_bytes", "xxh3", "file"});
    MadeVersion made;
    made.version.version = in.whole("version", 1, most_versions);
    made.version.parent = in.whole("parent", 0, made.version.version - 1);
    made.version.edit = in.text("edit");
    made.version.created = in.time("created");
    made.version.gaussians = in.count("gaussians");
    made.version.disk_bytes = in.count("disk_bytes");
    made.memory_bytes = in.count("memory_bytes");
    made.digest = in.digest("xxh3");
    made.file = in.text("file");
    if (made.file.find('/') != std::string::npos) throw Wrong{"expected a file's name", in.address("file")};
    return made;
  });
}

std::optional<std::size_t> place_of(const Manifest& manifest, int version) {
  const auto& versions = manifest.scene.versions;
  const auto found = std::ranges::lower_bound(versions, version, {}, &VersionInfo::version);
  if (found == versions.end() || found->version != version) return std::nullopt;
  return std::size_t(found - versions.begin());
}

Result<Manifest> read_manifest(const std::filesystem::path& folder) {
  const auto bytes = engine::io::read_bytes(folder / manifest_name, max_manifest_bytes);
  if (!bytes) return propagate(bytes);
  const std::string file = (folder.filename() / manifest_name).string();
  const std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  return decoded(text, file, [&](const json& document) { return decode(document, text); });
}

Result<void> write_manifest(const std::filesystem::path& folder, const Manifest& manifest) {
  const std::string text = text_of(manifest);
  return engine::write_file(folder / manifest_name, std::as_bytes(std::span(text)));
}

bool is_written(const std::filesystem::path& folder, const Manifest& manifest) {
  const auto bytes = engine::io::read_bytes(folder / manifest_name, max_manifest_bytes);
  const std::string text = text_of(manifest);
  return bytes && std::ranges::equal(*bytes, std::as_bytes(std::span(text)));
}

std::string dataset_list_name(const DatasetLocation& location) {
  return std::filesystem::path(location.folder).begin()->string() + ".xxh3";
}

std::string overlay_name(int version) { return "versions/" + std::to_string(version) + ".overlay"; }

}  // namespace server::scenes
