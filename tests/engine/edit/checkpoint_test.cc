#include "engine/edit/checkpoint.h"

#include <gtest/gtest.h>

#include "engine/core/checksum.h"
#include "engine/edit/drag.h"
#include "tests/engine/edit/samples.h"

namespace engine::edit {
namespace {

Checkpoint sample() {
  const scene::GaussianCloud scene = ball_before_wall(6);
  Request request;
  request.mode = Mode::extend;
  request.handles = {{DVec3(0), DVec3(0.7, 0, 0), 0.3, 0}};
  request.params.exclude_views = {"", "a view"};
  request.params.seed = 0x1234567890abcdef;
  const auto assignment = assign(scene.mean, request);
  EXPECT_TRUE(assignment);
  WorkingScene working = begin(scene, request, assignment->handle);
  Checkpoint checkpoint;
  checkpoint.positions = drag_through(working, request, 2, true).positions;
  checkpoint.interval = 2;
  checkpoint.members = members_of(working);
  checkpoint.views = arc_of_cameras(2, 13);
  for (const scene::Camera& view : checkpoint.views) {
    scene::Mask mask(view.width, view.height);
    for (std::size_t i = 0; i < mask.data.size(); ++i) mask.data[i] = i * i % 7 == 1;
    checkpoint.masks.push_back(mask);
  }
  checkpoint.report.resolved = request.params;
  checkpoint.report.resolved.rotation = Rotation::none;
  checkpoint.report.resolved.interpolation = Interpolation::rigid;
  checkpoint.report.handles = {{6, {DVec3(0.1, 0.2, 0.3), DVec3(1, 2, 3)}}};
  checkpoint.report.views = {{"view_0", 0.25}};
  checkpoint.report.input_gaussians = scene.size();
  checkpoint.report.output_gaussians = 1, checkpoint.report.changeable = 2;
  checkpoint.report.copies = 3, checkpoint.report.removed = 4;
  checkpoint.report.warnings = {"something \"odd\""};
  checkpoint.report.times = {{"deform", 0.5}};
  return checkpoint;
}

TEST(Checkpoint, IsReadAsItWasWritten) {
  const Checkpoint written = sample();
  const std::string bytes = encode(written);
  const auto read = decode(bytes);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->interval, 2);
  EXPECT_EQ(read->members, written.members);
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
  EXPECT_EQ(read->report.warnings, written.report.warnings);
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
  Checkpoint written = sample();
  params::for_each_parameter([&](const auto& parameter) {
    const Params before = written.report.resolved;
    alter(written.report.resolved.*parameter.value);
    ASSERT_NE(written.report.resolved, before) << parameter.name;
    const auto read = decode(encode(written));
    ASSERT_TRUE(read) << parameter.name;
    EXPECT_EQ(read->report.resolved, written.report.resolved) << parameter.name;
  });
}

TEST(Checkpoint, HoldsTheMembersAndNotTheFrozenRows) {
  const Checkpoint checkpoint = sample();
  EXPECT_EQ(checkpoint.members.inputs.size(), 6u);
  EXPECT_EQ(checkpoint.members.cloud.size(), 6u * 3) << "originals, and a copy of each per interval";
  for (const Role role : checkpoint.members.role) EXPECT_NE(role, Role::frozen);
}

TEST(Checkpoint, CutAnywhereItIsAnError) {
  const std::string bytes = encode(sample());
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const auto read = decode(std::string_view(bytes).substr(0, length));
    ASSERT_FALSE(read) << length;
    EXPECT_EQ(read.error().code, ErrorCode::corrupt_data) << length;
    EXPECT_EQ(read.error().where, "checkpoint");
  }
  EXPECT_FALSE(decode(bytes + '\0'));
}

TEST(Checkpoint, AnyFlippedBitIsFound) {
  std::string bytes = encode(sample());
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const int bit = int(i % 8);
    bytes[i] = char(bytes[i] ^ 1 << bit);
    EXPECT_FALSE(decode(bytes)) << i;
    bytes[i] = char(bytes[i] ^ 1 << bit);
  }
  EXPECT_TRUE(decode(bytes));
}

TEST(Checkpoint, AnotherVersionIsNamed) {
  std::string bytes = encode(sample());
  bytes[8] = 77;
  const auto read = decode(bytes);
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::unsupported);
  EXPECT_NE(read.error().message.find("77"), std::string::npos) << read.error().message;
}

TEST(Checkpoint, LengthsThatLieAreFoundEvenUnderARightChecksum) {
  // Whatever eight bytes of the contents say, decode() ends in an error or a checkpoint, not in a crash.
  const std::string good = encode(sample());
  for (std::size_t i = 12; i + 16 <= good.size(); ++i)
    for (const std::uint64_t lie : {~std::uint64_t{0}, std::uint64_t{1} << 61, std::uint64_t{1} << 31}) {
      std::string bytes = good;
      bytes.replace(i, 8, reinterpret_cast<const char*>(&lie), 8);
      const auto contents = std::as_bytes(std::span(bytes)).first(bytes.size() - 8);
      const std::uint64_t checksum = fnv1a(contents);
      bytes.replace(bytes.size() - 8, 8, reinterpret_cast<const char*>(&checksum), 8);
      if (const auto read = decode(bytes); !read) {
        EXPECT_EQ(read.error().code, ErrorCode::corrupt_data);
      }
    }
}

TEST(MemberRows, PutBackGiveTheWorkingSceneAgain) {
  for (const DVec3 center : {DVec3(0), DVec3(65536, 0, -65536)})
    for (const Mode mode : {Mode::move, Mode::extend}) {
      const scene::GaussianCloud scene = ball_before_wall(40, Vec3(center));
      Request request;
      request.mode = mode;
      request.handles = {{center, center + DVec3(0.4, 0.1, 0), 0.3, 0},
                         {center + DVec3(0.05, 0, 0), std::nullopt, 0.1, 0}};
      const auto assignment = assign(scene.mean, request);
      ASSERT_TRUE(assignment);
      WorkingScene working = begin(scene, request, assignment->handle);
      drag_through(working, request, 3, true);
      WorkingScene fresh = begin(scene, request, deform::HandleColumn(scene.size(), 0));
      ASSERT_TRUE(restore(members_of(working), fresh));
      EXPECT_EQ(fresh.cloud, working.cloud);
      EXPECT_EQ(fresh.handle, working.handle);
      EXPECT_EQ(fresh.role, working.role);
      EXPECT_EQ(fresh.parent, working.parent);
      EXPECT_EQ(fresh.mean_at_deform, working.mean_at_deform);
    }
}

}  // namespace
}  // namespace engine::edit
