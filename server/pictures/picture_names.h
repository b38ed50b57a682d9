// File names for the pictures of views.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/camera.h"

namespace server::pictures {

/// One name per view, without extension, in the order of the views: "0001.jpg" becomes "0001", "left/0001.jpg" becomes
/// "left_0001". All differ: where two would be the same, the second keeps its extension ("0001.jpg"), and where that is
/// taken, too, it gets a number.
[[nodiscard]] std::vector<std::string> picture_names(const std::vector<engine::scene::Camera>& views);

}  // namespace server::pictures
