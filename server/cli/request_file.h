// Edit requests and selections on disk.
#pragma once

#include <filesystem>
#include <string>

#include "engine/core/result.h"
#include "proto/edit_request.h"
#include "proto/selection.h"

namespace server::cli {

/// Reads a request file of any form that proto::parse_request_file() knows.
///   name    which of several; empty: the only one
///   errors  those of parse_request_file() and of reading; `where` begins with the file's name:
///           "drags.json:ear_up.handles[2].radius"
[[nodiscard]] engine::Result<proto::RequestFile> read_request(const std::filesystem::path& path,
                                                              const std::string& name);

/// Reads a selection: of any form that proto::parse_selection_file() knows. `name` and errors as read_request().
[[nodiscard]] engine::Result<proto::Selection> read_selection(const std::filesystem::path& path,
                                                              const std::string& name);

}  // namespace server::cli
