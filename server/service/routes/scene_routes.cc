#include "server/service/routes/scene_routes.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <sstream>
#include <utility>

#include "engine/core/numbers.h"
#include "engine/io/image_file.h"
#include "proto/scene.h"
#include "proto/time_text.h"
#include "server/edits/cameras.h"
#include "server/edits/points.h"
#include "server/http/negotiation.h"
#include "server/pictures/photo_comparison.h"

namespace server::service::routes {
namespace {

using edits::to_point;
using edits::to_vec;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::Result;
using http::Call;
using http::Reply;
using scenes::FileFormat;
using scenes::SceneInfo;
using scenes::SceneStore;

constexpr const char* upload_name = "upload";  // of a file that its client does not name

proto::SceneVersion to_proto(const scenes::VersionInfo& version) {
  return {version.version,   version.parent,    version.edit, version.name, proto::rfc3339(version.created),
          version.gaussians, version.disk_bytes};
}

proto::SceneDataset to_proto(const scenes::DatasetInfo& dataset) {
  return {dataset.kind,          dataset.views,           dataset.photos,  dataset.psnr_mean_db,
          dataset.psnr_worst_db, dataset.psnr_worst_view, dataset.warnings};
}

Result<Reply> reply_with(const Result<SceneInfo>& scene) {
  if (!scene) return propagate(scene);
  return Reply::json(proto::to_json(told(*scene)));
}

scenes::Uploader uploader_of(const Call& call) {
  const http::TokenPtr token = call.token();
  return token == nullptr ? scenes::Uploader() : scenes::Uploader{token->name, token->quotas.bytes};
}

/// The least that is stored of an upload, as far as its length is declared. A form is longer than the file in it; what
/// is in a zip file is about as long as that, or longer: half of it is on the safe side.
std::uint64_t least_stored(const Call& call, bool is_zip) {
  constexpr std::uint64_t most_of_a_form = 64 * 1024;  // around the file: a choice
  const auto declared = engine::number_in<std::uint64_t>(call.header("content-length")).value_or(0);
  const std::uint64_t file = declared > most_of_a_form ? declared - most_of_a_form : 0;
  return std::max<std::uint64_t>(is_zip ? file / 2 : file, 1);
}

/// Hands an uploaded file, and its name, to `take`. Whoever may not store it has to send nothing.
///   replaced  the scene whose dataset it replaces; empty: it is a scene
template <class Take>
Result<SceneInfo> with_upload(const Call& call, SceneStore& store, const std::string& replaced, Take take) {
  const std::uint64_t least = least_stored(call, /*is_zip=*/!replaced.empty());
  if (const auto fits = store.check_quota(uploader_of(call), least, replaced); !fits) return propagate(fits);
  const auto scratch = store.scratch();
  if (!scratch) return propagate(scratch);
  const auto file = scratch->folder() / upload_name;
  const auto received = call.receive(file);
  if (!received) return propagate(received);
  return take(file, received->filename.empty() ? std::string(upload_name) : received->filename);
}

Result<SceneInfo> add_scene(const Call& call, SceneStore& store) {
  const auto name = call.query("name");
  if (name && name->empty()) return fail(ErrorCode::invalid_argument, "expected a name, or none at all", "name");
  if (!call.is_json())
    return with_upload(call, store, {}, [&](const std::filesystem::path& file, const std::string& filename) {
      return store.add_upload(file, filename, name.value_or(""), uploader_of(call));
    });
  const auto source = proto::parse_scene_source(call.body());
  if (!source) return propagate(source);
  if (name && !source->name.empty())
    return fail(ErrorCode::invalid_argument, "the name is given twice: in the query and in the body", "name");
  return store.add_path(source->path, name.value_or(source->name), uploader_of(call));
}

Result<Reply> post_scene(const Call& call, SceneStore& store) {
  const auto added = add_scene(call, store);
  if (!added) return propagate(added);
  Reply reply = Reply::json(proto::to_json(told(*added)), 201);
  reply.headers.emplace_back("Location", "/v1/scenes/" + added->id);
  return reply;
}

Result<Reply> list_scenes(SceneStore& store) {
  std::vector<proto::Scene> all;
  for (const SceneInfo& scene : store.list()) all.push_back(told(scene));
  return Reply::json(proto::to_json(all));
}

Result<Reply> patch_scene(const Call& call, const SceneRouteDependencies& dependencies) {
  const auto wanted = proto::parse_scene_patch(call.body());
  if (!wanted) return propagate(wanted);
  SceneStore::Patch patch;
  patch.name = wanted->name;
  if (wanted->up) patch.up = *wanted->up ? std::optional(to_vec(**wanted->up)) : std::nullopt;
  const std::string& id = call.path("id");
  if (!patch.up) return reply_with(dependencies.store.patch(id, patch));
  // Which views an edit chooses depends on what is up: it must not change while one waits or is carried out.
  std::optional<Result<SceneInfo>> patched;
  const auto done = dependencies.while_idle(id, [&]() -> Result<void> {
    patched = dependencies.store.patch(id, patch);
    return {};
  });
  return done ? reply_with(*patched) : propagate(done);
}

Result<pictures::PhotoComparison> compare_photos(const SceneInfo& scene, const SceneRouteDependencies& dependencies) {
  const auto dataset = dependencies.store.dataset(scene.id);
  if (!dataset) return propagate(dataset);
  if (!*dataset) return pictures::PhotoComparison{};
  const auto version = dependencies.store.load(scene.id, "0");
  if (!version) return propagate(version);
  return pictures::compare_with_photos(
      **dataset, [&](const engine::scene::Camera& camera) { return dependencies.renders.colors(*version, camera); },
      dependencies.renders.options().memory);
}

/// Notes how well renders of version 0 agree with the photos of a dataset that has just been put. Put it is, whatever
/// becomes of this: a failure is a warning.
SceneInfo with_quality(SceneInfo scene, const SceneRouteDependencies& dependencies) {
  if (scene.dataset->photos == 0) return scene;
  auto found = compare_photos(scene, dependencies);
  if (!found) {
    const std::string why = found.error().message;
    found.emplace();
    found->warnings.push_back("the photos could not be compared with renders of the scene: " + why);
  }
  const auto noted = dependencies.store.set_dataset_quality(scene.id, scene.dataset->number, found->mean_db,
                                                            found->worst_db, found->worst_view, found->warnings);
  if (noted) return *noted;
  scene.dataset->warnings = found->warnings;
  scene.dataset->warnings.push_back("what the comparison with its photos found could not be kept: " +
                                    noted.error().message);
  return scene;
}

Result<Reply> put_dataset(const Call& call, const SceneRouteDependencies& dependencies) {
  const std::string& id = call.path("id");
  if (const auto known = dependencies.store.find(id); !known) return propagate(known);  // before gigabytes are received
  // An edit that is interrupted goes on with the cameras it began with.
  const auto change = [&](const std::function<Result<SceneInfo>()>& replace) {
    Result<SceneInfo> scene;
    const auto done = dependencies.while_idle(id, [&]() -> Result<void> {
      scene = replace();
      if (!scene) return propagate(scene);
      return {};
    });
    return done ? scene : propagate(done);
  };
  const auto put = [&]() -> Result<SceneInfo> {
    if (!call.is_json())
      return with_upload(
          call, dependencies.store, id, [&](const std::filesystem::path& file, const std::string& filename) {
            return change([&] { return dependencies.store.put_dataset_zip(id, file, filename, uploader_of(call)); });
          });
    const auto source = proto::parse_dataset_source(call.body());
    if (!source) return propagate(source);
    return change([&] { return dependencies.store.put_dataset_path(id, source->path); });
  }();
  if (!put) return propagate(put);
  return reply_with(with_quality(*put, dependencies));
}

/// Of a photo as get_photo() answers it: by what it is made of, so that nothing has to be decoded to tell.
std::string photo_etag(const engine::io::View& view, int max_side, const std::string& program) {
  std::error_code unknown;  // a file that is gone has a tag, too, which nobody will ever be told
  std::ostringstream text;
  text << std::hexfloat << program << ' ' << view.photo.string() << ' '
       << std::filesystem::file_size(view.photo, unknown) << ' '
       << std::filesystem::last_write_time(view.photo, unknown).time_since_epoch().count() << ' ' << max_side;
  const auto add = [&text](const auto& pinhole) {
    text << ' ' << pinhole.width << ' ' << pinhole.height;
    for (const double value : {pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy}) text << ' ' << value;
  };
  add(view.camera);
  if (view.lens) {
    add(*view.lens);
    text << ' ' << int(view.lens->model);
    for (const double value : view.lens->k) text << ' ' << value;
    for (const double value : view.lens->p) text << ' ' << value;
  }
  return http::etag_of(text.str());
}

/// A photo of the dataset, undistorted as its camera is, within max_side.
Result<Reply> get_photo(const Call& call, const SceneRouteDependencies& dependencies) {
  const std::string view = call.query("view").value_or("");
  if (view.empty()) return fail(ErrorCode::invalid_argument, "expected the name of a view of the dataset", "view");
  const int limit = dependencies.renders.options().max_side;
  const auto side = engine::number_in<int>(call.query("max_side").value_or(std::to_string(limit)));
  if (!side || *side < 1 || *side > limit)
    return fail(ErrorCode::invalid_argument, "expected 1 to " + std::to_string(limit) + " pixels", "max_side");
  const auto dataset = dependencies.store.dataset(call.path("id"));
  if (!dataset) return propagate(dataset);
  if (!*dataset) return fail(ErrorCode::not_found, "the scene has no dataset", "dataset");
  const auto& views = (*dataset)->views;
  const auto found = std::ranges::find(views, view, [](const auto& one) { return one.camera.name; });
  if (found == views.end() || found->photo.empty())
    return fail(ErrorCode::not_found, "the dataset has no photo of that name", "view");
  const RenderServiceOptions& options = dependencies.renders.options();
  const std::string etag = photo_etag(*found, *side, options.program);
  if (call.has(etag)) return Reply::not_modified(etag);
  Result<std::vector<std::byte>> bytes;
  // Decoding takes as long as a picture: it waits for its turn among them. What it takes is held until all is done.
  const auto done = dependencies.renders.run_in_turn([&] {
    const auto share = engine::take_from(options.memory, engine::io::photo_memory(*found), "view");
    if (!share) return void(bytes = propagate(share));
    bytes = dependencies.store.load_photo(*found)
                .and_then([&](engine::scene::Image photo) -> Result<engine::scene::Image> {
                  const auto camera = engine::scene::fit_within(found->camera, *side);
                  if (photo.width <= camera.width) return photo;
                  return engine::io::resized(photo, camera.width, camera.height);
                })
                .and_then([](const engine::scene::Image& photo) {
                  return engine::io::encode_image(photo, engine::io::ImageFormat::jpeg);
                });
  });
  if (!done) return propagate(done);
  if (!bytes) return propagate(bytes);
  Reply reply;
  reply.media_type = "image/jpeg";
  reply.body.assign(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  reply.etag = etag;
  return reply;
}

Result<Reply> delete_dataset(const Call& call, const SceneRouteDependencies& dependencies) {
  const std::string& id = call.path("id");
  Result<SceneInfo> scene;
  // An edit that is interrupted goes on with the cameras it began with.
  const auto done = dependencies.while_idle(id, [&]() -> Result<void> {
    scene = dependencies.store.remove_dataset(id);
    return scene.map([](const SceneInfo&) {});
  });
  return done ? reply_with(scene) : propagate(done);
}

Result<Reply> get_views(const Call& call, SceneViews& views) {
  const auto set = views.views_of(call.path("id"), [&call] { return call.gone(); });
  if (!set) return propagate(set);
  std::vector<proto::View> out;
  for (const SceneView& view : (*set)->views)
    out.push_back({view.camera.name, edits::to_proto(view.camera), view.photo});
  return Reply::json(proto::to_json(out, (*set)->is_virtual ? "virtual" : "dataset"));
}

Result<Reply> get_version(const Call& call, SceneStore& store) {
  const std::string& id = call.path("id");
  const auto version = store.find_version(id, call.path("v"));
  if (!version) return propagate(version);
  return Reply::json(proto::to_json(to_proto(*version), id));
}

Result<Reply> patch_version(const Call& call, SceneStore& store) {
  const auto wanted = proto::parse_version_patch(call.body());
  if (!wanted) return propagate(wanted);
  const std::string& id = call.path("id");
  const auto version = store.rename_version(id, call.path("v"), wanted->name);
  if (!version) return propagate(version);
  return Reply::json(proto::to_json(to_proto(*version), id));
}

/// The format asked for; "original" is that of the file the scene came in.
Result<FileFormat> file_format(const Call& call, SceneStore& store) {
  const std::string format = call.query("format").value_or("ply");
  if (format == "original") {
    const auto scene = store.find(call.path("id"));
    if (!scene) return propagate(scene);
    return engine::value_named<FileFormat>(scene->format).value_or(FileFormat::ply);
  }
  if (const auto found = engine::value_named<FileFormat>(format)) return *found;
  return fail(ErrorCode::invalid_argument, "expected one of ply, compressed_ply, splat, spz, sog, glb, original",
              "format");
}

/// As RFC 6266 wants it: a name in ASCII for all, and the true one for those who understand it.
std::string attachment(const std::string& name) {
  std::string plain, encoded;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool harmless =
        (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '.' || c == '-' || c == '_';
    constexpr const char* digits = "0123456789ABCDEF";
    plain += harmless || c == ' ' ? c : '_';
    encoded += harmless ? std::string(1, c) : std::string{'%', digits[byte >> 4], digits[byte & 15]};
  }
  return "attachment; filename=\"" + plain + "\"; filename*=UTF-8''" + encoded;
}

Result<Reply> get_file(const Call& call, SceneStore& store) {
  const auto format = file_format(call, store);
  if (!format) return propagate(format);
  auto file = store.file(call.path("id"), call.path("v"), *format);
  if (!file) return propagate(file);
  Reply reply;
  reply.media_type = "application/octet-stream";
  reply.etag = std::move(file->etag);
  reply.headers.emplace_back("Content-Disposition", attachment(file->download_name));
  reply.file = std::move(file->path);
  reply.hold = std::move(file->hold);
  return reply;
}

void add_dataset_routes(http::Router& router, const SceneRouteDependencies& dependencies) {
  SceneViews& views = dependencies.views;
  router.add({.method = "PUT",
              .path = "/v1/scenes/{id}/dataset",
              .handler = [dependencies](const Call& call) { return put_dataset(call, dependencies); },
              .body = http::Body::upload,
              .queries = {},
              .access = http::Access::edit});
  router.add({.method = "DELETE",
              .path = "/v1/scenes/{id}/dataset",
              .handler = [dependencies](const Call& call) { return delete_dataset(call, dependencies); },
              .queries = {},
              .access = http::Access::edit});
  router.add({.method = "GET",
              .path = "/v1/scenes/{id}/photo",
              .handler = [dependencies](const Call& call) { return get_photo(call, dependencies); },
              .queries = {"view", "max_side"},
              .access = http::Access::read});
  router.add({.method = "GET",
              .path = "/v1/scenes/{id}/views",
              .handler = [&views](const Call& call) { return get_views(call, views); },
              .queries = {},
              .access = http::Access::read});
}

void add_version_routes(http::Router& router, const SceneRouteDependencies& dependencies) {
  SceneStore& store = dependencies.store;
  router.add({.method = "GET",
              .path = "/v1/scenes/{id}/versions/{v}",
              .handler = [&store](const Call& call) { return get_version(call, store); },
              .queries = {},
              .access = http::Access::read});
  router.add({.method = "PATCH",
              .path = "/v1/scenes/{id}/versions/{v}",
              .handler = [&store](const Call& call) { return patch_version(call, store); },
              .body = http::Body::json,
              .queries = {},
              .access = http::Access::edit});
  router.add({.method = "DELETE",
              .path = "/v1/scenes/{id}/versions/{v}",
              .handler = [dependencies](const Call& call) -> Result<Reply> {
                const auto removed = dependencies.remove_version(call.path("id"), call.path("v"));
                if (!removed) return propagate(removed);
                return Reply::no_content();
              },
              .queries = {},
              .access = http::Access::edit});
  router.add({.method = "GET",
              .path = "/v1/scenes/{id}/versions/{v}/file",
              .handler = [&store](const Call& call) { return get_file(call, store); },
              .queries = {"format"},
              .access = http::Access::read});
}

}  // namespace

proto::Scene told(const SceneInfo& scene) {
  proto::Scene out;
  out.id = scene.id, out.name = scene.name;
  out.created = proto::rfc3339(scene.created);
  out.format = scene.format;
  out.gaussians = scene.versions[0].gaussians;
  out.sh_degree = scene.sh_degree;
  out.low = to_point(scene.low), out.high = to_point(scene.high), out.centre = to_point(scene.centre);
  out.radius = scene.radius;
  if (scene.up) out.up = to_point(*scene.up);
  out.disk_bytes = scene.disk_bytes, out.memory_bytes = scene.memory_bytes;
  out.views = scene.dataset ? scene.dataset->views : virtual_view_count;
  if (scene.dataset) out.dataset = to_proto(*scene.dataset);
  for (const auto& version : scene.versions) out.versions.push_back(to_proto(version));
  return out;
}

void add_scene_routes(http::Router& router, const SceneRouteDependencies& dependencies) {
  SceneStore& store = dependencies.store;
  router.add({.method = "GET",
              .path = "/v1/scenes",
              .handler = [&store](const Call&) { return list_scenes(store); },
              .queries = {},
              .access = http::Access::read});
  router.add({.method = "POST",
              .path = "/v1/scenes",
              .handler = [&store](const Call& call) { return post_scene(call, store); },
              .body = http::Body::upload,
              .queries = {"name"},
              .access = http::Access::edit});
  router.add({.method = "GET",
              .path = "/v1/scenes/{id}",
              .handler = [&store](const Call& call) { return reply_with(store.find(call.path("id"))); },
              .queries = {},
              .access = http::Access::read});
  router.add({.method = "PATCH",
              .path = "/v1/scenes/{id}",
              .handler = [dependencies](const Call& call) { return patch_scene(call, dependencies); },
              .body = http::Body::json,
              .queries = {},
              .access = http::Access::edit});
  router.add({.method = "DELETE",
              .path = "/v1/scenes/{id}",
              .handler = [dependencies](const Call& call) -> Result<Reply> {
                const std::string& id = call.path("id");
                const auto removed = dependencies.while_idle(id, [&] { return dependencies.store.remove(id); });
                if (!removed) return propagate(removed);
                return Reply::no_content();
              },
              .queries = {},
              .access = http::Access::edit});
  add_dataset_routes(router, dependencies);
  add_version_routes(router, dependencies);
}

}  // namespace server::service::routes
