#include "engine/edit/checkpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/checksum.h"
#include "tests/engine/edit/drags.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

/// The middle of an extend, with something in every field.
struct Sample {
  scene::GaussianCloud input;
  Request request;
  State state;

  explicit Sample(scene::GaussianCloud scene = ball_before_wall(6)) : input(std::move(scene)) {
    request.mode = Mode::extend;
    request.handles = {{DVec3(0), DVec3(0.7, 0, 0), 0.3, 0}};
    request.params.exclude_views = {"", "a view"};
    request.params.seed = 0x1234567890abcdef;
    request.params.rotation = Rotation::none;
    request.params.interpolation = Interpolation::rigid;
    state.scene = begun(input, request);
    state.positions = carry_out(state.scene, request, 2).positions;
    state.interval = 2;
    state.views = arc_of_cameras(2, 13);
    for (const scene::Camera& view : state.views) {
      scene::Mask mask(view.width, view.height);
      for (std::size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = i * i % 7 == 1;
      state.masks.push_back(mask);
    }
    Report& report = state.report;
    report.resolved = request.params;
    report.resolved.intervals = resolved_intervals(request);
    report.handles = {{6, {DVec3(0.1, 0.2, 0.3), DVec3(1, 2, 3)}}};
    report.views = {{"view_0", 0.25}};
    report.uncovered = {{"view_0", 0.25, 0.125, DVec2(0.5, 0.25), DVec2(0.75, 1)}};
    report.input_gaussians = input.size();
    report.output_gaussians = 1, report.changeable = 2;
    report.copies = 3, report.seeds = 5, report.removed = 4, report.crumbs = 6, report.relit = 7;
    report.losses = {0.5, 0.25};
    report.warnings = {"something \"odd\""};
    report.times = {{Stage::deform, 0.5}};
  }
  [[nodiscard]] Result<State> read(std::string_view bytes) const { return decode(bytes, input, request); }
};

/// The bytes with the checksum that they ought to have.
std::string checked(std::string bytes) {
  const std::uint64_t checksum = fnv1a(std::as_bytes(std::span(bytes)).first(bytes.size() - sizeof(std::uint64_t)));
  bytes.replace(bytes.size() - sizeof checksum, sizeof checksum, reinterpret_cast<const char*>(&checksum),
                sizeof checksum);
  return bytes;
}

TEST(Checkpoint, IsReadAsItWasWritten) {
  const Sample sample;
  const State& written = sample.state;
  const std::string bytes = encode(written);
  const auto read = sample.read(bytes);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->interval, 2);
  EXPECT_EQ(read->scene.cloud(), written.scene.cloud());
  EXPECT_EQ(read->scene.frame(), written.scene.frame());
  EXPECT_EQ(read->scene.input_rows(), written.scene.input_rows());
  EXPECT_EQ(working::members_of(read->scene), working::members_of(written.scene));
  EXPECT_EQ(read->positions, written.positions);
  EXPECT_EQ(read->masks, written.masks);
  ASSERT_EQ(read->views.size(), 2u);
  EXPECT_EQ(read->views[1].name, "view_1");
  EXPECT_EQ(read->views[1].rotation, written.views[1].rotation);
  EXPECT_EQ(read->views[1].cx, written.views[1].cx);
  EXPECT_EQ(read->report.resolved.exclude_views, written.report.resolved.exclude_views);
  EXPECT_EQ(read->report.resolved.seed, written.report.resolved.seed);
  EXPECT_EQ(read->report.resolved.rotation, Rotation::none);
  EXPECT_EQ(read->report.handles[0].relocated, written.report.handles[0].relocated);
  ASSERT_EQ(read->report.uncovered.size(), 1u);
  EXPECT_EQ(read->report.uncovered[0].view, "view_0");
  EXPECT_EQ(read->report.uncovered[0].open_to, DVec2(0.75, 1));
  EXPECT_EQ(read->report.losses, written.report.losses);
  EXPECT_EQ(read->report.warnings, written.report.warnings);
  ASSERT_EQ(read->report.times.size(), 1u);
  EXPECT_EQ(read->report.times[0].stage, Stage::deform);
  EXPECT_EQ(encode(*read), bytes) << "so nothing else was lost either";
}

/// A value that a parameter does not have by itself.
void alter(int& value) { ++value; }
void alter(double& value) { value /= 2; }
void alter(std::uint64_t& value) { value += 1; }
void alter(bool& value) { value = !value; }
void alter(std::vector<std::string>& value) { value.emplace_back("another"); }
template <Named Enum>
void alter(Enum& value) {
  const auto& all = names<Enum>;
  value = all.back().value == value ? all.front().value : all.back().value;
}

TEST(Checkpoint, HoldsEveryParameter) {
  Sample sample;
  Params& written = sample.state.report.resolved;
  params::for_each_parameter([&](const auto& parameter) {
    const Params before = written;
    alter(written.*parameter.value);
    ASSERT_NE(written, before) << parameter.name;
    EXPECT_FALSE(decode(encode(sample.state), sample.input, sample.request)) << parameter.name << " is another's";
    sample.request.params = written;
    const auto read = decode(encode(sample.state), sample.input, sample.request);
    ASSERT_TRUE(read) << parameter.name;
    EXPECT_EQ(read->report.resolved, written) << parameter.name;
  });
}

TEST(Checkpoint, HoldsTheMembersAndNotTheFrozenRows) {
  const Sample sample;
  const working::Members members = working::members_of(sample.state.scene);
  EXPECT_EQ(members.inputs.size(), 6u);
  EXPECT_EQ(members.cloud.size(), 6u * 3) << "originals, and a copy of each per interval";
  for (const working::Role role : members.role) EXPECT_NE(role, working::Role::frozen);
  scene::GaussianCloud larger = sample.input;
  scene::append_rows(larger, larger, std::vector<std::uint32_t>(1000, std::uint32_t(larger.size() - 1)));
  EXPECT_EQ(encode(Sample(std::move(larger)).state).size(), encode(sample.state).size()) << "a thousand more of wall";
}

TEST(Checkpoint, CutAnywhereItIsAnError) {
  const Sample sample;
  const std::string bytes = encode(sample.state);
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const auto read = sample.read(std::string_view(bytes).substr(0, length));
    ASSERT_FALSE(read) << length;
    EXPECT_EQ(read.error().code, ErrorCode::corrupt_data) << length;
    EXPECT_EQ(read.error().where, "checkpoint");
  }
  EXPECT_FALSE(sample.read(bytes + '\0'));
}

TEST(Checkpoint, AnyFlippedBitIsFound) {
  const Sample sample;
  std::string bytes = encode(sample.state);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const int bit = int(i % 8);
    bytes[i] = char(bytes[i] ^ 1 << bit);
    EXPECT_FALSE(sample.read(bytes)) << i;
    bytes[i] = char(bytes[i] ^ 1 << bit);
  }
  EXPECT_TRUE(sample.read(bytes));
}

TEST(Checkpoint, AnotherVersionIsNamed) {
  const Sample sample;
  std::string bytes = encode(sample.state);
  bytes[8] = 77;
  const auto read = sample.read(bytes);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::unsupported);
  EXPECT_NE(read.error().message.find("77"), std::string::npos) << read.error().message;
}

TEST(Checkpoint, LengthsThatLieAreFoundEvenUnderARightChecksum) {
  // Whatever eight bytes of the contents say, decode() ends in an error or in a state that holds, not in a crash.
  const Sample sample;
  const std::string good = encode(sample.state);
  for (std::size_t i = 12; i + 16 <= good.size(); ++i)
    for (const std::uint64_t lie : {~std::uint64_t{0}, std::uint64_t{1} << 61, std::uint64_t{1} << 31}) {
      std::string bytes = good;
      bytes.replace(i, 8, reinterpret_cast<const char*>(&lie), 8);
      const auto read = sample.read(checked(std::move(bytes)));
      if (read) {
        EXPECT_TRUE(read->scene.check()) << i;
        EXPECT_EQ(read->scene.input_rows(), sample.input.size()) << i;
      } else {
        // Damage; or what reads well, and belongs to no edit of this scene.
        EXPECT_TRUE(read.error().code == ErrorCode::corrupt_data || read.error().code == ErrorCode::invalid_argument);
        EXPECT_EQ(read.error().where, "checkpoint") << i;
      }
    }
}

TEST(Checkpoint, RowsThatMakeNoSceneAreRefusedEvenUnderARightChecksum) {
  const Sample sample;
  std::string bytes = encode(sample.state);
  constexpr std::size_t first_row = 24;  // after magic, version, interval, and the number of rows
  ASSERT_EQ(working::members_of(sample.state.scene).inputs.at(0), std::uint32_t(std::uint8_t(bytes[first_row])));
  std::swap_ranges(bytes.begin() + first_row, bytes.begin() + first_row + 4, bytes.begin() + first_row + 4);
  const auto read = sample.read(checked(bytes));
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::invalid_argument);
  EXPECT_EQ(read.error().where, "checkpoint");
}

}  // namespace
}  // namespace engine::edit
