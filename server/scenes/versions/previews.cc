#include "server/scenes/versions/previews.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "engine/core/numbers.h"

namespace server::scenes {

Preview Previews::add(const Snapshot& at, BoundedCache::CachedObject overlay, BoundedCache::Reservation reservation) {
  const std::string& scene = at.scene->id;
  std::string name;
  std::optional<std::pair<std::string, std::string>> oldest;
  {
    const std::lock_guard lock(mutex_);
    name = engine::numbered_id('p', ++last_);
    if (records_.size() >= std::max<std::size_t>(options_.max_previews, 1)) {
      const auto first = std::ranges::min_element(
          records_, {}, [](const auto& record) { return std::pair(record.second.expires, record.first); });
      oldest.emplace(first->second.scene, first->first);
    }
  }
  if (oldest) forget(oldest->first, oldest->second);
  overlay.can_be_made_again = false;
  memory_.put(scene + "/" + name, std::move(overlay), std::move(reservation));
  const Time expires = expiry();
  const std::lock_guard lock(mutex_);
  records_[name] = {scene, scene + "-" + at.manifest->nonce + "-" + name + "-" + process_nonce_, expires};
  return {name, expires};
}

std::optional<Previews::LoadedPreview> Previews::find(const std::string& scene, const std::string& preview) {
  expire();
  LoadedPreview held;
  {
    const std::lock_guard lock(mutex_);
    const auto record = records_.find(preview);
    if (record == records_.end() || record->second.scene != scene) return std::nullopt;
    record->second.expires = expiry();
    held.key = record->second.key;
  }
  held.overlay = memory_.find<engine::scene::Overlay>(scene + "/" + preview);
  if (held.overlay) return held;
  forget(scene, preview);  // it made room for something else
  return std::nullopt;
}

bool Previews::has(const std::string& preview) const {
  const std::lock_guard lock(mutex_);
  return records_.contains(preview);
}

std::size_t Previews::size() {
  expire();
  const std::lock_guard lock(mutex_);
  return records_.size();
}

void Previews::forget(const std::string& scene, const std::string& preview) {
  {
    const std::lock_guard lock(mutex_);
    records_.erase(preview);
  }
  memory_.forget(scene + "/" + preview);
  files_.forget(scene + "/" + preview);
}

void Previews::forget_all_of(const std::string& scene) {
  const std::lock_guard lock(mutex_);
  std::erase_if(records_, [&](const auto& record) { return record.second.scene == scene; });
}

void Previews::expire() {
  std::vector<std::pair<std::string, std::string>> expired;
  {
    const std::lock_guard lock(mutex_);
    const Time moment = options_.clock();
    for (const auto& [name, record] : records_)
      if (record.expires <= moment) expired.emplace_back(record.scene, name);
  }
  for (const auto& [scene, name] : expired) forget(scene, name);
}

}  // namespace server::scenes
