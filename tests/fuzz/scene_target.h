// What the targets of scene files share.
#pragma once

#include <string>
#include <vector>

#include "engine/io/scene_file.h"
#include "tests/engine/io/samples.h"
#include "tests/fuzz/fuzz.h"

namespace fuzz {

/// Reads bytes as a scene file, by a path.
inline void read_as_scene(std::span<const std::byte> bytes) {
  static engine::io::MemoryFile file;
  file.set(std::string(text_of(bytes)));
  const auto scene = engine::io::read_scene(file.path(), small_limits());
  if (scene) demand(!engine::scene::first_not_finite(scene->cloud), "a scene that is accepted is finite");
  if (!scene) demand(!scene.error().message.empty(), "an error has a message");
  demand(small_limits().memory->lent() == 0, "what was lent is given back");
}

}  // namespace fuzz
