#include "server/edits/convert_selection.h"

#include <algorithm>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

#include "engine/core/rows.h"
#include "engine/edit/handles.h"
#include "engine/io/image_file.h"
#include "engine/render/forward.h"
#include "engine/select/shown.h"
#include "server/edits/cameras.h"
#include "server/edits/points.h"

namespace server::edits {
namespace {

namespace on_wire = proto::selection;
namespace scene = engine::scene;
namespace select = engine::select;
using engine::DVec2;
using engine::DVec3;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;
using engine::Result;

static_assert(on_wire::max_operations == select::max_operations && on_wire::max_points == select::max_points &&
              on_wire::max_masks == select::max_views && on_wire::max_ranges == select::max_ranges &&
              on_wire::max_pixel_position == select::max_pixel_position);

Result<scene::Camera> camera_of(const proto::Viewpoint& viewpoint, const Viewpoints& known, const std::string& where) {
  if (const auto* camera = std::get_if<proto::Camera>(&viewpoint))
    return to_camera(*camera, known.up, where + ".camera.");
  const auto& name = std::get<std::string>(viewpoint);
  const auto found = std::ranges::find(known.views, name, &scene::Camera::name);
  if (found != known.views.end()) return *found;
  if (known.views.empty())
    return fail(ErrorCode::not_found,
                "views of a selection are those of a dataset, and none was given: name one, or give the camera itself, "
                "as `camera`",
                where + ".view");
  std::vector<std::string> first;
  for (const scene::Camera& view : known.views.first(std::min<std::size_t>(known.views.size(), 3)))
    first.push_back(view.name);
  return tl::make_unexpected(no_such_view(first, known.views.size(), where + ".view"));
}

Result<void> fix(proto::Viewpoint& viewpoint, const Viewpoints& known, const std::string& where) {
  const auto camera = camera_of(viewpoint, known, where);
  if (!camera) return propagate(camera);
  viewpoint = proto::Camera(to_proto(*camera));
  return {};
}

/// Precondition: with_cameras() has been here.
scene::Camera fixed(const proto::Viewpoint& viewpoint) {
  return to_camera(std::get<proto::Camera>(viewpoint), default_up, "").value();
}

/// What is at least half of white counts.
scene::Mask mask_of(const scene::Image& image) {
  scene::Mask mask(image.width, image.height);
  const auto red = image.plane(0), green = image.plane(1), blue = image.plane(2);
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    mask.data[i] = red[i] + green[i] + blue[i] >= 1.5f ? std::uint8_t{1} : std::uint8_t{0};
  return mask;
}

std::string size_text(int width, int height) { return std::to_string(width) + " x " + std::to_string(height); }

Result<scene::Mask> decode(const std::string& file, const scene::Camera& camera, const std::string& where) {
  const std::size_t pixels = std::size_t(camera.width) * std::size_t(camera.height);
  const std::string expected = "expected a mask of the camera's " + size_text(camera.width, camera.height) + " pixels";
  const auto image = engine::io::decode_image(
      std::as_bytes(std::span(file)), where, {.max_side = std::max(camera.width, camera.height), .max_pixels = pixels});
  if (!image && image.error().code == ErrorCode::too_large)
    return fail(ErrorCode::invalid_argument, expected + ", found a larger one", where);
  if (!image) return fail(image.error().code, "the mask cannot be read: " + image.error().message, where);
  if (image->width != camera.width || image->height != camera.height)
    return fail(ErrorCode::invalid_argument, expected + ", found " + size_text(image->width, image->height), where);
  return mask_of(*image);
}

std::vector<DVec3> to_vecs(const std::vector<proto::Point>& points) {
  std::vector<DVec3> out;
  for (const proto::Point& point : points) out.push_back(to_vec(point));
  return out;
}

std::vector<DVec2> to_vecs(const std::vector<on_wire::Pixel>& pixels) {
  std::vector<DVec2> out;
  for (const on_wire::Pixel& pixel : pixels) out.emplace_back(pixel[0], pixel[1]);
  return out;
}

select::Depth to_engine(on_wire::Depth depth) {
  return depth == on_wire::Depth::visible ? select::Depth::visible : select::Depth::through;
}

select::Op to_engine(on_wire::Op op) {
  switch (op) {
    case on_wire::Op::subtract:
      return select::Op::subtract;
    case on_wire::Op::intersect:
      return select::Op::intersect;
    case on_wire::Op::add:
      break;
  }
  return select::Op::add;
}

/// Makes actions the engine's, one after the other, and counts the masks.
class Actions {
 public:
  /// where  address of the action: "selection[2].masks"
  Result<select::Action> operator()(const on_wire::Action& action, const std::string& where) {
    where_ = where;
    return std::visit([this](const auto& given) -> Result<select::Action> { return this->convert(given); }, action);
  }

 private:
  using Action = Result<select::Action>;

  static Action convert(const on_wire::Sphere& given) { return select::Sphere{to_vec(given.center), given.radius}; }
  static Action convert(const on_wire::Box& given) {
    const auto& [w, x, y, z] = given.rotation;
    return select::Box{to_vec(given.center), to_vec(given.size), engine::DQuat(w, x, y, z)};
  }
  static Action convert(const on_wire::Plane& given) {
    return select::Plane{to_vec(given.point), to_vec(given.normal)};
  }
  static Action convert(const on_wire::Polygon& given) {
    return select::Polygon{fixed(given.viewpoint), to_vecs(given.points), to_engine(given.depth)};
  }
  static Action convert(const on_wire::Stroke& given) {
    return select::Stroke{fixed(given.viewpoint), to_vecs(given.points), given.radius, to_engine(given.depth)};
  }
  static Action convert(const on_wire::Grow& given) {
    return select::Grow{to_vecs(given.inside), to_vecs(given.outside), given.reach, given.whole, given.wider};
  }
  Action convert(const on_wire::Masks& given) {
    select::Masks masks;
    for (std::size_t i = 0; i < given.views.size(); ++i) {
      const std::string image = where_ + "[" + std::to_string(i) + "].image";
      const scene::Camera camera = fixed(given.views[i].viewpoint);
      mask_pixels_ += std::size_t(camera.width) * std::size_t(camera.height);
      if (mask_pixels_ > max_mask_pixels)
        return fail(ErrorCode::too_large,
                    "the masks of a selection have at most " + std::to_string(max_mask_pixels) +
                        " pixels in all: scale the views and their masks down",
                    image);
      auto mask = decode(given.views[i].image, camera, image);
      if (!mask) return propagate(mask);
      masks.views.push_back({camera, *std::move(mask)});
    }
    return masks;
  }
  static Action convert(const on_wire::Rows& given) {
    select::Rows rows;
    for (const auto& [from, to] : given.ranges) rows.ranges.push_back({from, to});
    return rows;
  }
  static Action convert(const on_wire::Expand& given) { return select::Expand{given.distance}; }
  static Action convert(const on_wire::Shrink& given) { return select::Shrink{given.distance}; }
  static Action convert(const on_wire::Largest& given) { return select::Largest{given.n}; }
  static Action convert(const on_wire::Invert&) { return select::Invert{}; }

  std::string where_;
  std::size_t mask_pixels_ = 0;
};

/// "selection[2].masks"
std::string address_of(const proto::Selection& selection, std::size_t operation) {
  return select::address(operation) + "." + std::string(on_wire::name_of(selection[operation].action));
}

/// The camera in whose picture the point lies nearest to the middle. Null: none shows it.
const scene::Camera* camera_on(DVec3 point, std::span<const scene::Camera> cameras) {
  const scene::Camera* best = nullptr;
  double nearest = std::numeric_limits<double>::infinity();
  for (const scene::Camera& camera : cameras) {
    const DVec3 in_camera = camera.cam_from_world(point);
    if (!(in_camera.z > 0)) continue;
    const DVec2 at = camera.pixel_from_cam(in_camera) / DVec2(camera.width, camera.height);
    if (!(at.x >= 0 && at.x <= 1 && at.y >= 0 && at.y <= 1)) continue;
    if (const double distance = glm::distance(at, DVec2(0.5)); distance < nearest) nearest = distance, best = &camera;
  }
  return best;
}

/// The views in which handles that move are seen best, each once, and the first handle of each.
struct HandleViews {
  std::vector<scene::Camera> views;
  std::vector<std::size_t> handles;
};
HandleViews handle_views(const std::vector<engine::edit::Handle>& handles, std::span<const scene::Camera> cameras) {
  constexpr int side = 256;             // pixels: enough to tell how much of a picture something takes
  constexpr std::size_t max_views = 4;  // a warning is not worth more
  HandleViews out;
  std::vector<const scene::Camera*> seen;
  for (std::size_t h = 0; h < handles.size() && seen.size() < max_views; ++h) {
    if (handles[h].is_anchor()) continue;
    const scene::Camera* const camera = camera_on(handles[h].source, cameras);
    if (camera == nullptr || std::ranges::find(seen, camera) != seen.end()) continue;
    seen.push_back(camera);
    out.views.push_back(scene::fit_within(*camera, side));
    out.handles.push_back(h);
  }
  return out;
}

}  // namespace

Result<proto::Selection> with_cameras(proto::Selection selection, const Viewpoints& viewpoints) {
  for (std::size_t i = 0; i < selection.size(); ++i) {
    const std::string where = address_of(selection, i);
    auto done = std::visit(
        [&](auto& action) -> Result<void> {
          using Kind = std::decay_t<decltype(action)>;
          if constexpr (std::is_same_v<Kind, on_wire::Polygon> || std::is_same_v<Kind, on_wire::Stroke>)
            return fix(action.viewpoint, viewpoints, where);
          if constexpr (std::is_same_v<Kind, on_wire::Masks>)
            for (std::size_t k = 0; k < action.views.size(); ++k)
              if (auto fine = fix(action.views[k].viewpoint, viewpoints, where + "[" + std::to_string(k) + "]"); !fine)
                return fine;
          return {};
        },
        selection[i].action);
    if (!done) return propagate(done);
  }
  return selection;
}

Result<select::Selection> to_engine(const proto::Selection& selection) {
  select::Selection out;
  Actions actions;
  for (std::size_t i = 0; i < selection.size(); ++i) {
    auto action = actions(selection[i].action, address_of(selection, i));
    if (!action) return propagate(action);
    out.push_back({to_engine(selection[i].op), *std::move(action)});
  }
  return out;
}

Result<select::Selected> carry_out(const scene::GaussianCloud& cloud, const proto::Selection& selection) {
  const auto operations = to_engine(selection);
  if (!operations) return propagate(operations);
  return select::select(cloud, *operations);
}

std::vector<std::string> warnings_of(const select::Selected& selected) {
  std::vector<std::string> sentences;
  for (const auto& [message, where] : selected.warnings)
    sentences.push_back(where == "selection" ? message : where + ": " + message);
  return sentences;
}

std::vector<scene::Camera> cameras_in(const proto::Selection& selection) {
  std::vector<scene::Camera> cameras;
  for (const on_wire::Operation& operation : selection) {
    if (const auto* polygon = std::get_if<on_wire::Polygon>(&operation.action))
      cameras.push_back(fixed(polygon->viewpoint));
    if (const auto* stroke = std::get_if<on_wire::Stroke>(&operation.action))
      cameras.push_back(fixed(stroke->viewpoint));
    if (const auto* masks = std::get_if<on_wire::Masks>(&operation.action))
      for (const on_wire::MaskedView& view : masks->views) cameras.push_back(fixed(view.viewpoint));
  }
  return cameras;
}

std::vector<std::string> hand_over(const select::Selected& selected, std::span<const scene::Camera> cameras,
                                   const ShownShares& shown_shares, engine::edit::Request& request) {
  request.selected = engine::marked_rows(selected.rows);
  engine::edit::give_radii(selected.bounds, request);
  std::vector<std::string> sentences = warnings_of(selected);
  const auto [views, handles] = handle_views(request.handles, cameras);
  if (views.empty() || selected.count == 0) return sentences;
  const std::vector<double> shares = shown_shares(views);
  for (std::size_t v = 0; v < views.size(); ++v)
    if (shares[v] > most_of_a_view)
      sentences.push_back("the selection takes " + std::to_string(int(100 * shares[v])) +
                          " % of what is seen around handle " + std::to_string(handles[v] + 1) +
                          ": subtract what is not meant to move");
  return sentences;
}

engine::Error about_healing(engine::Error error) {
  constexpr std::string_view selection = "selection";
  if (error.where.starts_with(selection)) error.where.replace(0, selection.size(), "heal");
  return error;
}

Result<std::vector<std::string>> hand_over_healed(const select::Selected& selected, engine::edit::Request& request) {
  request.healed = engine::marked_rows(selected.rows);
  if (request.healed.empty())
    return fail(engine::ErrorCode::unprocessable, "what is to be healed holds no Gaussian: add to it, or leave it out",
                "heal");
  std::vector<std::string> sentences;
  for (const auto& [message, where] : selected.warnings)
    sentences.push_back(about_healing({engine::ErrorCode::invalid_argument, message, where}).where + ": " + message);
  return sentences;
}

Result<std::vector<std::string>> heal_rows(const scene::GaussianCloud& cloud, const proto::Selection& selection,
                                           const Viewpoints& viewpoints, engine::edit::Request& request) {
  const auto resolved = with_cameras(selection, viewpoints);
  if (!resolved) return tl::make_unexpected(about_healing(resolved.error()));
  const auto selected = carry_out(cloud, *resolved);
  if (!selected) return tl::make_unexpected(about_healing(selected.error()));
  return hand_over_healed(*selected, request);
}

Result<std::vector<std::string>> select_rows(const scene::GaussianCloud& cloud, const proto::Selection& selection,
                                             const Viewpoints& viewpoints, engine::edit::Request& request) {
  const auto resolved = with_cameras(selection, viewpoints);
  if (!resolved) return propagate(resolved);
  const auto selected = carry_out(cloud, *resolved);
  if (!selected) return propagate(selected);
  const auto shown_shares = [&](const auto& views) { return select::shown_shares(cloud, selected->rows, views); };
  if (!viewpoints.views.empty()) return hand_over(*selected, viewpoints.views, shown_shares, request);
  return hand_over(*selected, cameras_in(*resolved), shown_shares, request);
}

}  // namespace server::edits
