// The stages of an edit that is a job: those of the engine, and what the job does before and after them.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <vector>

#include "engine/core/names.h"
#include "engine/edit/plan.h"

namespace server::edits {

enum class JobStage : std::uint8_t {
  load,     ///< The request is read, and the version it is about.
  publish,  ///< The result is made a version of the scene.
};

constexpr auto names_of(JobStage) {
  return std::array{engine::Name{JobStage::load, "load"}, engine::Name{JobStage::publish, "publish"}};
}
using engine::name_of;

/// Of all stages, as they are called on the wire, in about the order in which they come.
[[nodiscard]] std::vector<std::string_view> stage_names();

}  // namespace server::edits
