#include "server/edits/interval_pictures.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "engine/io/image_file.h"
#include "engine/jobs/durable_file.h"
#include "engine/render/forward.h"

namespace server::edits {
namespace {

constexpr std::string_view before_checksum = "SDCHKSUM";  // after the JPEG, and before the checksum of all before
constexpr std::string_view end_of_jpeg = "\xff\xd9";

std::string with_checksum(const std::string& jpeg) {
  engine::ByteWriter out;
  out.write_all(std::span(jpeg));
  out.write_all(std::span(before_checksum));
  out.write(engine::fnv1a(out.bytes()));
  return std::move(out).take();
}

constexpr int jpeg_quality = 90;  // 1 to 100; what POST .../render has by default. A choice.

Result<std::string> encoded(const engine::scene::Image& picture) {
  const auto bytes = engine::io::encode_image(picture, engine::io::ImageFormat::jpeg, {.jpeg_quality = jpeg_quality});
  if (!bytes) return engine::propagate(bytes);
  return std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size());
}

}  // namespace

Result<std::string> read_picture(const std::filesystem::path& file) {
  auto bytes = engine::jobs::read_bytes(file);
  if (!bytes) return bytes;
  constexpr std::size_t added = before_checksum.size() + sizeof(std::uint64_t);
  if (bytes->size() > added && std::string_view(*bytes).substr(bytes->size() - added).starts_with(before_checksum)) {
    const std::string jpeg = bytes->substr(0, bytes->size() - added);
    if (with_checksum(jpeg) == *bytes) return jpeg;
  } else if (bytes->ends_with(end_of_jpeg)) {
    return bytes;
  }
  return engine::fail(engine::ErrorCode::corrupt_data, "the stored picture is damaged", file);
}

std::string picture_name(int interval, std::size_t view, std::string_view stage) {
  return "interval-" + std::to_string(interval) + "-view-" + std::to_string(view) + "-" + std::string(stage) + ".jpg";
}

IntervalPictures::IntervalPictures(std::filesystem::path folder, const engine::scene::GaussianCloud& input, int views)
    : folder_(std::move(folder)), input_(input), count_(std::size_t(std::max(0, views))) {}

Result<void> IntervalPictures::add(const engine::edit::Moment& moment) {
  if (moment.interval != interval_) {
    interval_ = moment.interval;
    renders_.clear();
  }
  const std::size_t count = std::min(count_, moment.views.size());
  if (count == 0) return {};
  std::vector<std::string> corrected;
  for (std::size_t v = 0; v < count && !moment.pictures.empty(); ++v) {
    auto jpeg = encoded(moment.pictures[v]);
    if (!jpeg) return engine::propagate(jpeg);
    corrected.push_back(std::move(*jpeg));
  }
  if (corrected.empty() && (cached_jpegs_.size() != count || cached_overlay_ != moment.overlay))
    if (auto rendered = render(moment); !rendered) return rendered;
  const std::vector<std::string>& jpegs = corrected.empty() ? cached_jpegs_ : corrected;
  Result<void> written = engine::jobs::create_folder(folder_);
  for (std::size_t v = 0; written && v < count; ++v)
    written =
        engine::jobs::write_durably(folder_ / picture_name(moment.interval, v, moment.name), with_checksum(jpegs[v]));
  if (!written)
    return engine::fail(written.error().code, "the pictures of interval " + std::to_string(moment.interval) +
                                                  " cannot be kept: " + written.error().message);
  renders_.resize(count);
  for (std::size_t v = 0; v < count; ++v) {
    renders_[v].view = moment.views[v].name;
    renders_[v].stages.push_back(moment.name);
  }
  return {};
}

Result<void> IntervalPictures::render(const engine::edit::Moment& moment) {
  const bool is_input = moment.overlay.removed.empty() && moment.overlay.rows.size() == 0;
  engine::scene::GaussianCloud edited;
  if (!is_input) edited = engine::scene::flatten(input_, moment.overlay);
  const engine::scene::GaussianCloud& cloud = is_input ? input_ : edited;
  cached_jpegs_.clear();
  engine::render::Workspace workspace;
  engine::render::Rendering picture;
  for (std::size_t v = 0; v < std::min(count_, moment.views.size()); ++v) {
    engine::render::forward(cloud, moment.views[v], {}, {}, workspace, picture);
    auto jpeg = encoded(picture.color);
    if (!jpeg) return engine::propagate(jpeg);
    cached_jpegs_.push_back(std::move(*jpeg));
  }
  cached_overlay_ = moment.overlay;
  return {};
}

std::vector<proto::IntervalRender> IntervalPictures::renders_of(int interval) const {
  return interval == interval_ ? renders_ : std::vector<proto::IntervalRender>{};
}

}  // namespace server::edits
