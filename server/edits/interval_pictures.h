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

/// "interval-2-view-0-before.jpg"
[[nodiscard]] std::string picture_name(int interval, std::size_t view, std::string_view stage);

/// Writes them as the moments come. The same moment gives the same bytes, in whatever run.
class IntervalPictures {
 public:
  /// folder  made if absent
  /// input   of the edit; outlives this
  /// views   that are pictured, of each moment's views the first
  IntervalPictures(std::filesystem::path folder, const engine::scene::GaussianCloud& input, int views);

  /// Renders the moment and puts its pictures on disk; they are there when this returns.
  ///   errors  no_space, unavailable: the message says what could not be written
  [[nodiscard]] Result<void> add(const engine::edit::Moment& moment);
  /// Those of an interval, as its record lists them.
  [[nodiscard]] std::vector<proto::IntervalRender> of(int interval) const;

 private:
  [[nodiscard]] Result<void> render(const engine::edit::Moment& moment);

  std::filesystem::path folder_;
  const engine::scene::GaussianCloud& input_;
  std::size_t count_;
  int interval_ = 0;  ///< That `renders_` is about.
  std::vector<proto::IntervalRender> renders_;
  engine::scene::Overlay shown_;  ///< What `jpegs_` show: an interval begins as the one before it ended.
  std::vector<std::string> jpegs_;
};

}  // namespace server::edits
