#include "engine/edit/checkpoint.h"

#include <algorithm>
#include <span>
#include <utility>

#include "engine/core/byte_reader.h"
#include "engine/core/byte_writer.h"
#include "engine/core/checksum.h"
#include "engine/edit/handles.h"
#include "engine/scene/cloud_arrays.h"
#include "engine/scene/cloud_bytes.h"

namespace engine::edit {
namespace {

using working::Members;
using working::Role;

constexpr std::string_view magic = "SDCHKPNT";
constexpr std::uint32_t version = 9;

// Each part is written and read by a pair of functions that name the same fields in the same order.

void write(ByteWriter& out, DVec3 v) { out.write(v.x), out.write(v.y), out.write(v.z); }

void read(ByteReader& in, DVec3& v) {
  for (int i = 0; i < 3; ++i) v[i] = in.read<double>();
}

void write(ByteWriter& out, const std::string& text) { out.write_string(text); }
void read(ByteReader& in, std::string& text) { text = in.read_string(); }

template <Scalar T>
void write(ByteWriter& out, const std::vector<T>& values) {
  out.write(std::uint64_t(values.size()));
  out.write_all(std::span(values));
}

template <Scalar T>
void read(ByteReader& in, std::vector<T>& values) {
  const auto count = in.read<std::uint64_t>();
  if (!in.has(count, sizeof(T))) return in.fail();
  values.resize(std::size_t(count));
  in.read_all(std::span(values));
}

// Declared before the lists that hold them.
void write(ByteWriter& out, const HandleReport& handle);
void read(ByteReader& in, HandleReport& handle);
void write(ByteWriter& out, const ViewReport& view);
void read(ByteReader& in, ViewReport& view);
void write(ByteWriter& out, const Uncovered& uncovered);
void read(ByteReader& in, Uncovered& uncovered);
void write(ByteWriter& out, const StageTime& time);
void read(ByteReader& in, StageTime& time);
void write(ByteWriter& out, const scene::Camera& camera);
void read(ByteReader& in, scene::Camera& camera);
void write(ByteWriter& out, const scene::Mask& mask);
void read(ByteReader& in, scene::Mask& mask);
void write(ByteWriter& out, const correct::HistoryPicture& picture);
void read(ByteReader& in, correct::HistoryPicture& picture);

/// A list of anything that takes at least four bytes.
template <class T>
void write_list(ByteWriter& out, const std::vector<T>& items) {
  out.write(std::uint64_t(items.size()));
  for (const T& item : items) write(out, item);
}

template <class T>
void read_list(ByteReader& in, std::vector<T>& items) {
  const auto count = in.read<std::uint64_t>();
  if (!in.has(count, 4)) return in.fail();
  for (std::uint64_t i = 0; i < count && in.ok(); ++i) read(in, items.emplace_back());
}

/// An enumerator, of which `last` is the last.
template <class Enum>
void read(ByteReader& in, Enum& value, Enum last) {
  const auto number = in.read<std::uint8_t>();
  if (number > std::uint8_t(last)) in.fail();
  value = Enum(number);
}

void write(ByteWriter& out, const Array3& array) { write(out, array.x), write(out, array.y), write(out, array.z); }
void read(ByteReader& in, Array3& array) { read(in, array.x), read(in, array.y), read(in, array.z); }

void write(ByteWriter& out, const Members& members) {
  write(out, members.inputs);
  scene::write_cloud(out, members.cloud);
  for (const Role role : members.role) out.write(std::uint8_t(role));
  write(out, members.handle);
  write(out, members.parent);
  write(out, members.mean_at_deform);
}

void read(ByteReader& in, Members& members) {
  read(in, members.inputs);
  members.cloud = scene::read_cloud(in);
  if (!in.has(members.cloud.size())) return in.fail();
  members.role.resize(members.cloud.size());
  for (Role& role : members.role) read(in, role, Role::relit);
  read(in, members.handle);
  read(in, members.parent);
  read(in, members.mean_at_deform);
}

void write(ByteWriter& out, const scene::Camera& camera) {
  write(out, camera.name);
  for (int column = 0; column < 3; ++column) write(out, camera.rotation[column]);
  write(out, camera.translation);
  for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) out.write(value);
  out.write(std::int32_t(camera.width)), out.write(std::int32_t(camera.height));
}

void read(ByteReader& in, scene::Camera& camera) {
  read(in, camera.name);
  for (int column = 0; column < 3; ++column) read(in, camera.rotation[column]);
  read(in, camera.translation);
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value = in.read<double>();
  camera.width = in.read<std::int32_t>(), camera.height = in.read<std::int32_t>();
}

void write(ByteWriter& out, const scene::Mask& mask) {
  out.write(std::int32_t(mask.width)), out.write(std::int32_t(mask.height));
  std::vector<std::uint8_t> packed((mask.data.size() + 7) / 8, 0);
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    packed[i / 8] = std::uint8_t(packed[i / 8] | mask.data[i] << i % 8);
  out.write_all(std::span(packed));
}

void read(ByteReader& in, scene::Mask& mask) {
  const auto width = in.read<std::int32_t>(), height = in.read<std::int32_t>();
  if (width < 0 || height < 0) return in.fail();
  const auto pixels = std::uint64_t(width) * std::uint64_t(height);
  const auto packed = in.take((pixels + 7) / 8);
  if (!in.ok()) return;
  mask = scene::Mask(width, height);
  for (std::size_t i = 0; i < mask.data.size(); ++i)
    mask.data[i] = std::uint8_t(std::to_integer<unsigned>(packed[i / 8]) >> i % 8 & 1u);
}

// The parameters' types.
void write(ByteWriter& out, int value) { out.write(std::int32_t(value)); }
void write(ByteWriter& out, double value) { out.write(value); }
void write(ByteWriter& out, std::uint64_t value) { out.write(value); }
void write(ByteWriter& out, bool value) { out.write(std::uint8_t(value)); }
void write(ByteWriter& out, const std::vector<std::string>& names) { write_list(out, names); }
template <Named Enum>
void write(ByteWriter& out, Enum value) {
  out.write(std::uint8_t(value));
}

void read(ByteReader& in, int& value) { value = in.read<std::int32_t>(); }
void read(ByteReader& in, double& value) { value = in.read<double>(); }
void read(ByteReader& in, std::uint64_t& value) { value = in.read<std::uint64_t>(); }
void read(ByteReader& in, bool& value) { value = in.read<std::uint8_t>() != 0; }
void read(ByteReader& in, std::vector<std::string>& names) { read_list(in, names); }
template <Named Enum>
void read(ByteReader& in, Enum& value) {
  read(in, value, names<Enum>.back().value);
}

void write(ByteWriter& out, const Params& params) {
  params::for_each_parameter([&](const auto& parameter) { write(out, params.*parameter.value); });
}

void read(ByteReader& in, Params& params) {
  params::for_each_parameter([&](const auto& parameter) { read(in, params.*parameter.value); });
}

void write(ByteWriter& out, const HandleReport& handle) {
  out.write(std::uint64_t(handle.gaussians));
  write_list(out, handle.relocated);
}

void read(ByteReader& in, HandleReport& handle) {
  handle.gaussians = std::size_t(in.read<std::uint64_t>());
  read_list(in, handle.relocated);
}

void write(ByteWriter& out, const ViewReport& view) { write(out, view.name), out.write(view.mask_area); }
void read(ByteReader& in, ViewReport& view) { read(in, view.name), view.mask_area = in.read<double>(); }

void write(ByteWriter& out, const Uncovered& uncovered) {
  write(out, uncovered.view);
  for (const double value : {uncovered.area, uncovered.open, uncovered.open_from.x, uncovered.open_from.y,
                             uncovered.open_to.x, uncovered.open_to.y})
    out.write(value);
}
void read(ByteReader& in, Uncovered& uncovered) {
  read(in, uncovered.view);
  for (double* value : {&uncovered.area, &uncovered.open, &uncovered.open_from.x, &uncovered.open_from.y,
                        &uncovered.open_to.x, &uncovered.open_to.y})
    *value = in.read<double>();
}

void write(ByteWriter& out, const StageTime& time) { out.write(std::uint8_t(time.stage)), out.write(time.seconds); }
void read(ByteReader& in, StageTime& time) {
  read(in, time.stage, names<Stage>.back().value), time.seconds = in.read<double>();
}

void write(ByteWriter& out, const Report& report) {
  write(out, report.resolved);
  write_list(out, report.handles);
  write_list(out, report.views);
  write_list(out, report.uncovered);
  for (const std::size_t count : {report.input_gaussians, report.output_gaussians, report.changeable, report.copies,
                                  report.seeds, report.removed, report.crumbs, report.relit})
    out.write(std::uint64_t(count));
  write(out, report.losses);
  write_list(out, report.warnings);
  write_list(out, report.times);
}

void read(ByteReader& in, Report& report) {
  read(in, report.resolved);
  read_list(in, report.handles);
  read_list(in, report.views);
  read_list(in, report.uncovered);
  for (std::size_t* count : {&report.input_gaussians, &report.output_gaussians, &report.changeable, &report.copies,
                             &report.seeds, &report.removed, &report.crumbs, &report.relit})
    *count = std::size_t(in.read<std::uint64_t>());
  read(in, report.losses);
  read_list(in, report.warnings);
  read_list(in, report.times);
}

void write(ByteWriter& out, const correct::HistoryPicture& picture) {
  out.write(std::int32_t(picture.interval)), out.write(std::uint64_t(picture.view));
  out.write(std::int32_t(picture.picture.width)), out.write(std::int32_t(picture.picture.height));
  out.write_all(std::span(picture.picture.data));
}
void read(ByteReader& in, correct::HistoryPicture& picture) {
  picture.origin = correct::Origin::edited;  // no others are written down
  picture.interval = in.read<std::int32_t>(), picture.view = std::size_t(in.read<std::uint64_t>());
  const auto width = in.read<std::int32_t>(), height = in.read<std::int32_t>();
  if (width < 0 || height < 0) return in.fail();
  const auto pixels = std::uint64_t(width) * std::uint64_t(height);
  if (!in.has(pixels, 3)) return in.fail();
  picture.picture = {width, height, std::vector<std::uint8_t>(3 * std::size_t(pixels))};
  in.read_all(std::span(picture.picture.data));
}

tl::unexpected<Error> damaged(const std::string& what) {
  return fail(ErrorCode::corrupt_data, "the checkpoint is damaged: " + what, "checkpoint");
}

/// What is written down of a state. Boxes of its history are those of the masks.
struct Contents {
  State state;  ///< But for its scene.
  Members members;
};

/// The contents between version and checksum.
Result<std::span<const std::byte>> contents_of(std::span<const std::byte> bytes) {
  ByteReader in(bytes);
  const auto found_magic = in.take(magic.size());
  if (!in.ok() || !std::ranges::equal(found_magic, std::as_bytes(std::span(magic))))
    return damaged("it does not begin as one");
  const auto found_version = in.read<std::uint32_t>();
  if (!in.ok()) return damaged("it ends too early");
  if (found_version != version)
    return fail(ErrorCode::unsupported,
                "the checkpoint is of version " + std::to_string(found_version) + "; this program reads version " +
                    std::to_string(version),
                "checkpoint");
  if (in.remaining() < sizeof(std::uint64_t)) return damaged("it ends too early");
  const auto checked = bytes.first(bytes.size() - sizeof(std::uint64_t));
  if (ByteReader(bytes.subspan(checked.size())).read<std::uint64_t>() != fnv1a(checked))
    return damaged("its checksum does not match");
  return checked.subspan(in.offset());
}

Result<Contents> read_contents(std::span<const std::byte> bytes) {
  ByteReader in(bytes);
  Contents contents;
  contents.state.interval = in.read<std::int32_t>();
  read(in, contents.members);
  read_list(in, contents.state.positions);
  read_list(in, contents.state.views);
  read_list(in, contents.state.masks);
  read(in, contents.state.report);
  read_list(in, contents.state.history);
  read(in, contents.state.repainter);
  read(in, contents.state.perceptual);
  if (!in.ok() || in.remaining() != 0) return damaged("its parts do not fit together");
  return contents;
}

}  // namespace

std::string encode(const State& state) {
  ByteWriter out;
  out.write_all(std::span(magic));
  out.write(version);
  out.write(std::int32_t(state.interval));
  write(out, working::members_of(state.scene));
  write_list(out, state.positions);
  write_list(out, state.views);
  write_list(out, state.masks);
  write(out, state.report);
  write_list(out, state.history);
  write(out, state.repainter);
  write(out, state.perceptual);
  out.write(fnv1a(out.bytes()));
  return std::move(out).take();
}

Result<State> decode(std::string_view text, const scene::GaussianCloud& input, const Request& request) {
  const auto bytes = contents_of(std::as_bytes(std::span(text)));
  if (!bytes) return propagate(bytes);
  auto contents = read_contents(*bytes);
  if (!contents) return propagate(contents);
  auto scene = working::restore(contents->members, input, frame_of(request));
  if (!scene) return fail(ErrorCode::invalid_argument, "the checkpoint is of an edit of another scene", "checkpoint");
  contents->state.scene = std::move(*scene);
  if (!is_of(input, request, contents->state))
    return fail(ErrorCode::invalid_argument, "the checkpoint is of another edit", "checkpoint");
  return std::move(contents->state);
}

}  // namespace engine::edit
