#include "server/edits/selections.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <span>
#include <tuple>
#include <utility>

#include "engine/core/checksum.h"
#include "engine/render/forward.h"
#include "engine/scene/overlay.h"
#include "engine/select/shown.h"
#include "server/edits/cameras.h"
#include "server/edits/convert_selection.h"
#include "server/edits/estimate.h"

namespace server::edits {
namespace {

namespace scene = engine::scene;
using engine::ErrorCode;
using engine::fail;
using engine::propagate;

/// "q" and 16 hexadecimal digits.
std::string id_of(const std::string& version, const proto::Selection& selection) {
  const std::string text = version + '\n' + proto::to_json(selection);
  std::array<char, 24> id{};
  std::snprintf(id.data(), id.size(), "q%016llx",
                static_cast<unsigned long long>(engine::fnv1a(std::as_bytes(std::span(text)))));
  return id.data();
}

bool is_same_view(const scene::Camera& a, const scene::Camera& b) {
  const auto values = [](const scene::Camera& c) { return std::tuple(c.fx, c.fy, c.cx, c.cy, c.width, c.height); };
  return a.rotation == b.rotation && a.translation == b.translation && values(a) == values(b);
}

}  // namespace

/// What is kept to select in one version. While nobody works at it, it does not hold the scene's memory: if that goes,
/// the desk is of no use any more.
struct Selections::Desk {
  explicit Desk(const scenes::LoadedVersion& version)
      : key(version.key),
        base(version.cloud.base),
        merged(version.cloud.overlay ? std::make_shared<const scene::GaussianCloud>(scene::flatten(version.cloud))
                                     : nullptr),
        cloud(merged ? *merged : *version.cloud.base),
        selector(cloud) {}

  [[nodiscard]] bool is_of(const scenes::LoadedVersion& version) const {
    return key == version.key && base.lock() == version.cloud.base;
  }
  [[nodiscard]] std::uint64_t bytes() const { return merged ? scene::memory_bytes(*merged) : 0; }

  std::string key;
  std::weak_ptr<const scene::GaussianCloud> base;
  std::shared_ptr<const scene::GaussianCloud> merged;  ///< Null: the version is its base.
  const scene::GaussianCloud& cloud;                   ///< Either of the two.
  engine::select::Selector selector;
  engine::edit::Memory drags;
  struct Shown {
    std::string selection;  ///< MadeSelection::id
    std::vector<scene::Camera> views;
    std::vector<double> shares;
  };
  std::optional<Shown> shown;  ///< Asked for last.
  TimePoint used{};
};

Selections::Selections(scenes::SceneStore& store, SelectionsOptions options)
    : store_(store), options_(std::move(options)) {}
Selections::~Selections() = default;

Result<proto::Selection> Selections::resolve(const std::string& scene, const proto::Selection& selection) const {
  const auto about = store_.find(scene);
  if (!about) return propagate(about);
  const auto dataset = store_.dataset(scene);
  if (!dataset) return propagate(dataset);
  const auto views = cameras_of(dataset->get());
  return with_cameras(selection, {.views = views, .up = about->up.value_or(default_up)});
}

Result<std::vector<scene::Camera>> Selections::cameras_about(const std::string& scene,
                                                             const proto::Selection& selection) const {
  const auto dataset = store_.dataset(scene);
  if (!dataset) return propagate(dataset);
  return *dataset ? cameras_of(dataset->get()) : cameras_in(selection);
}

Result<std::shared_ptr<const MadeSelection>> Selections::make(const scenes::LoadedVersion& version,
                                                              const proto::Selection& selection) {
  auto made = std::make_shared<MadeSelection>();
  made->id = id_of(version.key, selection);
  if (auto before = known(version.key, made->id); before && before->asked == selection) return before;
  const auto operations = to_engine(selection);
  if (!operations) return propagate(operations);
  auto desk = take_desk(version);
  auto selected = desk->selector.select(*operations);
  put_back(std::move(desk));
  if (!selected) return propagate(selected);
  made->version = version.key;
  made->asked = selection;
  made->selected = *std::move(selected);
  keep(made);
  return std::shared_ptr<const MadeSelection>(std::move(made));
}

Result<std::shared_ptr<const MadeSelection>> Selections::find(const scenes::LoadedVersion& version,
                                                              const std::string& id) {
  if (auto made = known(version.key, id)) return made;
  return fail(ErrorCode::not_found,
              "this version has no such selection: selections are kept for a while only, post it again to .../select",
              "selection");
}

std::vector<double> Selections::shown_shares(const scenes::LoadedVersion& version, const MadeSelection& made,
                                             const std::vector<scene::Camera>& views) {
  auto desk = take_desk(version);
  auto& shown = desk->shown;
  if (!shown || shown->selection != made.id || !std::ranges::equal(shown->views, views, is_same_view))
    shown = Desk::Shown{made.id, views, engine::select::shown_shares(desk->cloud, made.selected.rows, views)};
  std::vector<double> shares = shown->shares;
  put_back(std::move(desk));
  return shares;
}

Result<engine::edit::PreviewOutcome> Selections::preview(const scenes::LoadedVersion& version,
                                                         const engine::edit::Request& request) {
  auto desk = take_desk(version);
  auto outcome = engine::edit::preview(version.cloud, request, desk->drags);
  put_back(std::move(desk));
  return outcome;
}

std::unique_ptr<Selections::Desk> Selections::take_desk(const scenes::LoadedVersion& version) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = std::ranges::find_if(desks_, [&](const auto& desk) { return desk->is_of(version); });
    if (found != desks_.end()) {
      std::unique_ptr<Desk> desk = std::move(*found);
      desks_.erase(found);
      return desk;
    }
  }
  return std::make_unique<Desk>(version);
}

void Selections::put_back(std::unique_ptr<Desk> desk) {
  std::list<std::unique_ptr<Desk>> garbage;  // destroyed after the lock is released
  const std::lock_guard lock(mutex_);
  const TimePoint now = options_.clock();
  desk->used = now;
  const auto drop = [&](auto which) { garbage.splice(garbage.end(), desks_, which); };
  for (auto kept = desks_.begin(); kept != desks_.end();) {
    const auto next = std::next(kept);
    const bool is_superseded = (*kept)->key == desk->key;
    if (is_superseded || (*kept)->base.expired() || now - (*kept)->used > options_.lifetime) drop(kept);
    kept = next;
  }
  std::uint64_t bytes = desk->bytes();
  for (const auto& kept : desks_) bytes += kept->bytes();
  desks_.push_back(std::move(desk));
  while (desks_.size() > options_.max_desks || (bytes > options_.desk_bytes && !desks_.empty())) {
    bytes -= desks_.front()->bytes();
    drop(desks_.begin());
  }
}

std::shared_ptr<const MadeSelection> Selections::known(const std::string& version, const std::string& id) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find_if(
      made_, [&](const Kept& kept) { return kept.made->id == id && kept.made->version == version; });
  if (found == made_.end()) return nullptr;
  found->used = options_.clock();
  made_.splice(made_.end(), made_, found);
  return made_.back().made;
}

void Selections::keep(const std::shared_ptr<const MadeSelection>& made) {
  std::list<Kept> garbage;  // destroyed after the lock is released
  const std::lock_guard lock(mutex_);
  const TimePoint now = options_.clock();
  std::uint64_t bytes = made->selected.rows.size();
  for (auto kept = made_.begin(); kept != made_.end();) {
    const auto next = std::next(kept);
    if (now - kept->used > options_.lifetime || kept->made->id == made->id)
      garbage.splice(garbage.end(), made_, kept);
    else
      bytes += kept->made->selected.rows.size();
    kept = next;
  }
  made_.push_back({made, now});
  while (made_.size() > options_.max_made || (bytes > options_.made_bytes && made_.size() > 1)) {
    bytes -= made_.front().made->selected.rows.size();
    garbage.splice(garbage.end(), made_, made_.begin());
  }
}

}  // namespace server::edits
