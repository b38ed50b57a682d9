// A scene as a base cloud and what differs from it: how versions and previews are kept without copies of the cloud.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/core/result.h"
#include "engine/core/soa.h"
#include "engine/core/vec.h"
#include "engine/scene/gaussian_cloud.h"

namespace engine::scene {

/// What turns a base cloud into another one. Rows of the result: the base's, in order, without `removed` and with
/// `changed` replaced; then the added ones.
/// Invariant: both lists ascend, share no row, and name rows of the base; rows.size() >= changed.size(); `rows` has the
/// base's sh_degree and extra_stride.
struct Overlay {
  std::vector<std::uint32_t> removed;  ///< Rows of the base that are gone.
  std::vector<std::uint32_t> changed;  ///< Rows of the base whose values are others.
  GaussianCloud rows;                  ///< Values of the changed rows, in the order of `changed`; then the added rows.

  [[nodiscard]] std::size_t added() const { return rows.size() - changed.size(); }
  bool operator==(const Overlay&) const = default;
};

/// A version of a scene: shared, never changed.
struct LayeredCloud {
  std::shared_ptr<const GaussianCloud> base;
  std::shared_ptr<const Overlay> overlay;  ///< Null: the base as it is.

  [[nodiscard]] std::size_t size() const;  ///< Rows of the result.
};

/// The overlay that changes nothing.
[[nodiscard]] Overlay no_change(const GaussianCloud& base);

/// The invariant of Overlay, for one that comes from a file.
///   errors  corrupt_data; `where` is "removed[3]", "changed[0]" or "rows"
[[nodiscard]] Result<void> validate(const Overlay& overlay, const GaussianCloud& base);

/// The cloud that base and overlay make.
[[nodiscard]] GaussianCloud flatten(const GaussianCloud& base, const Overlay& overlay);
[[nodiscard]] GaussianCloud flatten(const LayeredCloud& cloud);

/// One overlay for two, of which `upper` was made for the result of `lower`: flatten(base, compose(lower, upper)) is
/// flatten(flatten(base, lower), upper), to the byte.
///   base_rows  of the cloud that `lower` was made for
[[nodiscard]] Overlay compose(std::size_t base_rows, const Overlay& lower, const Overlay& upper);

/// Some rows of the result (indices into it, in any order), without making all of it.
[[nodiscard]] GaussianCloud gather(const LayeredCloud& cloud, std::span<const std::uint32_t> rows);
/// The means of all rows of the result: 12 bytes each.
[[nodiscard]] Array3 means(const LayeredCloud& cloud);

/// How many means of the result lie within `radius` of `point`: strictly, in double, as deform::assign() counts them.
[[nodiscard]] std::size_t count_within(const LayeredCloud& cloud, DVec3 point, double radius);

/// Bytes that a cloud, an overlay holds.
[[nodiscard]] std::size_t memory_bytes(const GaussianCloud& cloud);
[[nodiscard]] std::size_t memory_bytes(const Overlay& overlay);

}  // namespace engine::scene
