// report.json: what an edit did, for programs.
#pragma once

#include <string>
#include <vector>

#include "engine/edit/edit.h"
#include "proto/edit_request.h"
#include "server/cli/compute.h"

namespace server::cli {

/// The pictures of one view, as file names, and how well the rest of the picture was left alone.
struct ViewPictures {
  std::string view, before, after, mask;
  double psnr_outside_db = 0;  ///< Before against after, outside the mask; infinity if not a bit differs.
};

/// What the report says.
struct EditReport {
  std::string scene_file;      ///< Name of the input.
  Machine machine;             ///< What it was computed on.
  proto::EditRequest request;  ///< The request as it was carried out.
  engine::edit::Report edit;
  std::vector<ViewPictures> pictures;
  double seconds = 0;  ///< Time of the edit, without reading and writing.
};

/// Indented JSON. An infinite PSNR is null.
[[nodiscard]] std::string to_json(const EditReport& report);

}  // namespace server::cli
