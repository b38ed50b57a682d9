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
#include "engine/select/footing.h"

namespace engine::edit {

/// Kept while somebody drags a handle, so that each position of the mouse is answered sooner. Belongs to one version of
/// a scene, and changes no result. For one thread at a time.
class Memory {
 public:
  /// select::contact_of()
  [[nodiscard]] const select::Contact& contact_of(const scene::LayeredCloud& scene, std::span<const std::uint32_t> part,
                                                  std::span<const std::uint32_t> selected);
  /// select::crumbs_of()
  [[nodiscard]] const std::vector<std::uint32_t>& crumbs_of(const scene::LayeredCloud& scene,
                                                            std::span<const std::uint32_t> selected);
  /// The stance that select::Stance's constructor makes of these.
  ///   touches  of contact_of() for `part` and `moved`
  [[nodiscard]] const select::Stance& stance_of(const scene::LayeredCloud& scene, const Array3& means,
                                                std::span<const std::uint32_t> part,
                                                std::span<const select::Touch> touches,
                                                std::span<const std::uint32_t> moved);
  /// The body that deform::Body's constructor makes of these.
  [[nodiscard]] const deform::Body& body_of(const scene::GaussianCloud& cloud, std::span<const std::uint32_t> rows,
                                            std::span<const deform::Drag> drags, std::span<const std::uint8_t> held);

  /// Seconds that this memory has saved so far: what was answered from it had taken so long to find out.
  [[nodiscard]] double saved_seconds() const { return saved_seconds_; }

 private:
  /// What was found out, and how long that took.
  template <class T>
  struct Noted {
    T found;
    double seconds = 0;
  };
  struct KnownContact {
    std::vector<std::uint32_t> part, selected;
    select::Contact contact;
  };
  struct Crumbs {
    std::vector<std::uint32_t> selected, rows;
  };

  template <class T, class Fits, class Make, class RowsOf>
  const T& find_or_make(std::list<Noted<T>>& known, Fits&& fits, Make&& make, RowsOf&& rows_of);

  std::list<Noted<Crumbs>> crumbs_;           ///< The one used last is last.
  std::list<Noted<KnownContact>> contacts_;   ///< The same.
  std::list<Noted<select::Stance>> stances_;  ///< The same.
  std::list<Noted<deform::Body>> bodies_;     ///< The same.
  double saved_seconds_ = 0;
};

}  // namespace engine::edit
