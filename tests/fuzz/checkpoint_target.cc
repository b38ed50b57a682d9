// The state of an edit. The checksum at the end is set right: what lies before it is believed no more for that.
#include "engine/edit/checkpoint.h"

#include <cstring>

#include "engine/core/checksum.h"
#include "engine/edit/drag.h"
#include "engine/edit/handles.h"
#include "tests/engine/edit/samples.h"
#include "tests/fuzz/fuzz.h"

namespace edit = engine::edit;

namespace {

/// The beginning of a drag, with two views and their masks.
struct Sample {
  engine::scene::GaussianCloud input = edit::ball_before_wall(6);
  edit::Request request;
  edit::State state;

  Sample() {
    request.mode = edit::Mode::extend;
    request.handles = {{engine::DVec3(0), engine::DVec3(0.7, 0, 0), 0.3, 0}};
    auto assignment = edit::assign(input, request);
    fuzz::demand(assignment.has_value(), "the sample's handle holds its ball");
    state.scene = {input, edit::frame_of(request), std::move(assignment->handle)};
    state.positions = {engine::DVec3(0.1, 0, 0)};
    state.interval = 1;
    state.views = edit::arc_of_cameras(2, 13);
    for (const engine::scene::Camera& view : state.views) state.masks.emplace_back(view.width, view.height);
    state.report.resolved = request.params;
    state.report.resolved.intervals = edit::resolved_intervals(request);
    state.report.input_gaussians = input.size();
    state.report.warnings = {"a warning"};
  }
};

const Sample& sample() {
  static const Sample made;
  return made;
}

}  // namespace

void fuzz::run(std::span<const std::byte> bytes) {
  std::string text(text_of(bytes));
  if (text.size() > sizeof(std::uint64_t)) {
    const std::size_t end = text.size() - sizeof(std::uint64_t);
    const std::uint64_t checksum = engine::fnv1a(std::as_bytes(std::span(text)).first(end));
    std::memcpy(text.data() + end, &checksum, sizeof checksum);
  }
  const auto state = edit::decode(text, sample().input, sample().request);
  if (!state) return;
  demand(state->scene.check(), "a state that is accepted holds");
  demand(state->scene.input_rows() == sample().input.size(), "a state is of this scene");
}

std::vector<std::string> fuzz::seeds() { return {edit::encode(sample().state)}; }
