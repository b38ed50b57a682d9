// What previews of drags on one version find out that does not depend on where the handles go.
#pragma once

#include <cstdint>
#include <list>
#include <span>
#include <vector>

#include "engine/deform/body.h"
#include "engine/scene/overlay.h"
#include "engine/select/contact.h"
#include "engine/select/crumbs.h"

namespace engine::edit {

/// Kept while somebody drags a handle, so that each position of the mouse is answered sooner. Belongs to one version of
/// a scene, and changes no result. For one thread at a time.
class Memory {
 public:
  /// select::contact_of()
  [[nodiscard]] const std::vector<select::Touch>& contact_of(const scene::LayeredCloud& scene,
                                                             std::span<const std::uint32_t> part,
                                                             std::span<const std::uint32_t> selected);
  /// select::crumbs_of()
  [[nodiscard]] const std::vector<std::uint32_t>& crumbs_of(const scene::LayeredCloud& scene,
                                                            std::span<const std::uint32_t> selected);
  /// The body that deform::Body's constructor makes of these.
  [[nodiscard]] const deform::Body& body_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                            std::span<const deform::Drag> drags, std::span<const std::uint8_t> held);

 private:
  struct Contact {
    std::vector<std::uint32_t> part, selected;
    std::vector<select::Touch> touches;
  };
  struct Crumbs {
    std::vector<std::uint32_t> selected, rows;
  };
  std::list<Crumbs> crumbs_;        ///< The one used last is last.
  std::list<Contact> contacts_;     ///< The same.
  std::list<deform::Body> bodies_;  ///< The same.
};

}  // namespace engine::edit
