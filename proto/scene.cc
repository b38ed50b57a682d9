#include "proto/scene.h"

#include <nlohmann/json.hpp>

#include "proto/camera_fields.h"
#include "proto/json_document.h"
#include "proto/json_text.h"

namespace proto {
namespace {

using engine::propagate;
using nlohmann::ordered_json;

constexpr std::size_t max_scene_name_bytes = 200;  // as the store has it (server/scenes/catalogue/names.cc)

template <class T>
ordered_json or_null(const std::optional<T>& value) {
  return value ? ordered_json(*value) : ordered_json(nullptr);
}
ordered_json or_null(const std::string& text) { return text.empty() ? ordered_json(nullptr) : ordered_json(text); }

ordered_json encode(const SceneVersion& version, const std::string& scene) {
  const std::string self = scene + "/versions/" + std::to_string(version.version);
  return {{"version", version.version},
          {"parent", or_null(version.parent)},
          {"edit", or_null(version.edit)},
          {"name", or_null(version.name)},
          {"created", version.created},
          {"gaussians", version.gaussians},
          {"disk_bytes", version.disk_bytes},
          {"links", {{"render", self + "/render"}, {"pick", self + "/pick"}, {"file", self + "/file?format=ply"}}}};
}

ordered_json encode(const SceneDataset& dataset) {
  return {{"kind", dataset.kind},
          {"views", dataset.views},
          {"photos", dataset.photos},
          {"psnr_mean_db", or_null(dataset.psnr_mean_db)},
          {"psnr_worst_db", or_null(dataset.psnr_worst_db)},
          {"psnr_worst_view", or_null(dataset.psnr_worst_view)},
          {"warnings", dataset.warnings}};
}

ordered_json encode(const Scene& scene) {
  const std::string self = "/v1/scenes/" + scene.id;
  ordered_json out{{"id", scene.id},
                   {"name", scene.name},
                   {"created", scene.created},
                   {"format", scene.format},
                   {"gaussians", scene.gaussians},
                   {"sh_degree", scene.sh_degree},
                   {"bounds", {{"low", scene.low}, {"high", scene.high}}},
                   {"centre", scene.centre},
                   {"radius", scene.radius},
                   {"up", or_null(scene.up)},
                   {"disk_bytes", scene.disk_bytes},
                   {"memory_bytes", scene.memory_bytes},
                   {"views", scene.views},
                   {"dataset", scene.dataset ? encode(*scene.dataset) : ordered_json(nullptr)}};
  ordered_json& versions = out["versions"] = ordered_json::array();
  for (const SceneVersion& version : scene.versions) versions.push_back(encode(version, self));
  out["links"] = {{"self", self}, {"views", self + "/views"}, {"dataset", self + "/dataset"}};
  return out;
}

ordered_json encode(const View& view) {
  ordered_json out{{"name", view.name}};
  out.update(encode(view.camera));
  out["photo"] = view.photo;
  return out;
}

std::string read_name(const JsonField& field) {
  std::string name = field.text();
  if (name.empty() || name.size() > max_scene_name_bytes)
    field.refuse("expected a name of 1 to " + std::to_string(max_scene_name_bytes) + " bytes");
  return name;
}

std::string read_path(const JsonField& field) {
  std::string path = field.text();
  if (path.empty()) field.refuse("expected a path below the scene root");
  return path;
}

PathSource read_scene_source(const JsonField& field) {
  const Members members(field, {"path", "name"});
  PathSource source;
  if (const auto f = members.required("path")) source.path = read_path(*f);
  if (const auto f = members.optional("name")) source.name = read_name(*f);
  return source;
}

PathSource read_dataset_source(const JsonField& field) {
  const Members members(field, {"path"});
  PathSource source;
  if (const auto f = members.required("path")) source.path = read_path(*f);
  return source;
}

ScenePatch read_scene_patch(const JsonField& field) {
  const Members members(field, {"name", "up"});
  ScenePatch patch;
  if (const auto f = members.optional("name")) patch.name = read_name(*f);
  if (const auto f = members.optional("up"))
    patch.up = f->is_null() ? std::optional<Point>() : std::optional(read_direction(*f));
  return patch;
}

VersionPatch read_version_patch(const JsonField& field) {
  const Members members(field, {"name"});
  VersionPatch patch;
  if (const auto f = members.required("name"); f && !f->is_null()) patch.name = read_name(*f);
  return patch;
}

template <class T>
Result<T> parse(std::string_view text, const JsonLimits& limits, T (*read)(const JsonField&)) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  std::optional<engine::Error> error;
  T value = read(JsonField(*document, "", error));
  if (error) return tl::make_unexpected(std::move(*error));
  return value;
}

}  // namespace

std::string to_json(const Scene& scene) { return pretty(encode(scene)); }

std::string to_json(const std::vector<Scene>& scenes) {
  ordered_json out{{"scenes", ordered_json::array()}};
  for (const Scene& scene : scenes) out["scenes"].push_back(encode(scene));
  return pretty(out);
}

std::string to_json(const SceneVersion& version, const std::string& scene) {
  return pretty(encode(version, "/v1/scenes/" + scene));
}

std::string to_json(const std::vector<View>& views, std::string_view kind) {
  ordered_json out{{"kind", kind}, {"views", ordered_json::array()}};
  for (const View& view : views) out["views"].push_back(encode(view));
  return pretty(out);
}

Result<PathSource> parse_scene_source(std::string_view text, const JsonLimits& limits) {
  return parse(text, limits, read_scene_source);
}
Result<PathSource> parse_dataset_source(std::string_view text, const JsonLimits& limits) {
  return parse(text, limits, read_dataset_source);
}
Result<ScenePatch> parse_scene_patch(std::string_view text, const JsonLimits& limits) {
  return parse(text, limits, read_scene_patch);
}
Result<VersionPatch> parse_version_patch(std::string_view text, const JsonLimits& limits) {
  return parse(text, limits, read_version_patch);
}

}  // namespace proto
