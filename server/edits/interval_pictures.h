// The pictures of an edit's intervals, as JPEG files in its job's folder.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/edit/edit.h"
#include "engine/scene/gaussian_cloud.h"
#include "proto/edit_status.h"

namespace server::edits {

using engine::Result;

/// Name of a file, such as "interval-2-view-0-before.jpg".
[[nodiscard]] std::string picture_name(int interval, std::size_t view, std::string_view stage);

/// Reads a picture that IntervalPictures wrote: JPEG bytes. On disk a checksum stands after them, where viewers of JPEG
/// files look no more; one of an earlier release has none, and has to end as a JPEG file does.
///   errors  corrupt_data: it is not what was written; not_found, unavailable
[[nodiscard]] Result<std::string> read_picture(const std::filesystem::path& file);

/// Writes the pictures of each moment. The same moment gives the same bytes, whether the edit was resumed or not.
class IntervalPictures {
 public:
  /// folder  is made if absent
  /// input   cloud that the edit began with; outlives this
  /// views   how many of each moment's views get pictures: the first ones
  IntervalPictures(std::filesystem::path folder, const engine::scene::GaussianCloud& input, int views);

  /// Renders the moment and puts its pictures on disk; they are there when this returns.
  ///   errors  no_space, unavailable: the message says what could not be written
  [[nodiscard]] Result<void> add(const engine::edit::Moment& moment);
  /// The pictures of the interval that was added last, as its record lists them; of any other interval, none.
  [[nodiscard]] std::vector<proto::IntervalRender> renders_of(int interval) const;

 private:
  [[nodiscard]] Result<void> render(const engine::edit::Moment& moment);

  std::filesystem::path folder_;
  const engine::scene::GaussianCloud& input_;
  std::size_t count_;
  int interval_ = 0;  ///< Interval that `renders_` lists.
  std::vector<proto::IntervalRender> renders_;
  engine::scene::Overlay cached_overlay_;  ///< What `cached_jpegs_` show; an interval begins as the last one ended.
  std::vector<std::string> cached_jpegs_;
};

}  // namespace server::edits
