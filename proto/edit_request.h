// The edit request as it travels: JSON in, a plain struct, JSON out. The names are the contract with clients.
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/params/params.h"
#include "proto/selection.h"
#include "proto/wire.h"

namespace proto {

using engine::name_of;  // of an enumerator, such as "shortest_arc"
using engine::params::Annealing;
using engine::params::Attach;
using engine::params::Background;
using engine::params::Corrector;
using engine::params::Crumbs;
using engine::params::Interpolation;
using engine::params::Mode;
using engine::params::Perceptual;
using engine::params::Preset;
using engine::params::Rotation;
using engine::params::Settle;
using engine::params::ShadowOfPart;

/// The parameters that a request gives; the rest is left to the preset.
using Params = engine::params::GivenParams;

constexpr std::size_t max_handles = 256;  ///< A choice: far above what people send, far below what would hurt.

constexpr double max_scale = 1000, min_scale = 1 / max_scale;  ///< A choice: far beyond use.

/// A point on the part that is dragged, and where it is to go.
struct Handle {
  Point source{};
  std::optional<Point> target;        ///< Where the handle is to go; without one, and without the two below, an anchor.
  std::optional<double> radius = {};  ///< World units, above 0. Left out only with a selection: how far it then grips
                                      ///< is found from what is selected.
  int group = 0;                      ///< Its group, from 0 up.
  std::optional<std::array<double, 4>> rotation = {};  ///< How it turns what it grips: w, x, y, z, not all 0.
  std::optional<double> scale = {};                    ///< How much larger that becomes: min_scale to max_scale.
  bool operator==(const Handle&) const = default;
};

/// A box that limits what may be dragged.
struct Region {
  Point center{}, size{};  ///< World units; full edge lengths, above 0.
  bool operator==(const Region&) const = default;
};

/// One edit as a client asks for it.
struct EditRequest {
  std::optional<std::string> scene;  ///< Id of a scene that a service holds.
  std::optional<int> version;        ///< Version of that scene, from 0 up.
  Mode mode = Mode::move;
  std::optional<Preset> preset;                     ///< None: standard.
  std::optional<std::string> prompt;                ///< For a corrector that reads one.
  std::optional<std::string> negative_prompt = {};  ///< The same: what should not be seen.
  std::optional<std::string> lora = {};             ///< Adapter that the same paints with, by name.
  bool allow_slow = false;                          ///< Its networks, of `sd` or of `lpips`, may work for hours.
  std::vector<Handle> handles;                      ///< 1 to max_handles
  std::optional<Selection> selection;               ///< What moves. None: the handles' spheres.
  std::optional<Selection> heal = {};               ///< What is made anew although it was seen.
  std::optional<Attach> attach = {};                ///< What holds it. None: auto.
  std::optional<Crumbs> crumbs = {};                ///< What becomes of what the selection has left out. None: move.
  std::optional<ShadowOfPart> shadow = {};          ///< What becomes of its shadow. None: move.
  std::optional<Settle> settle = {};                ///< Where it arrives that stands on something. None: automatic.
  std::optional<Region> region;
  Params params;
  bool operator==(const EditRequest&) const = default;
};

/// Decodes a request. Strict: a field that is unknown, missing, given twice, of the wrong type, not finite or out of
/// range is an error.
///   errors  invalid_argument: `where` is the field's address, such as "handles[2].radius" or "params.views", or for
///           text that is no JSON "line 3, column 7"; too_large: a limit, which the message names
[[nodiscard]] Result<EditRequest> parse_edit_request(std::string_view text, const JsonLimits& limits = {});

/// Decodes a configuration file as released with 3DGS-Drag:
///   start       [n][3] source of each handle          direction  [n][3] its motion: target = start + direction
///   voxel_size  radius of every handle                 cluster    [n] group of each handle; default: all 0
///   local_mask  {"center": [3], "xyz": [3]}: the region, with full edge lengths; default: none
///   mode        "move" or "extend"; default: "move"
/// A direction of exactly zero makes an anchor: the released program moves such a handle by nothing.
///   errors  as parse_edit_request()
[[nodiscard]] Result<EditRequest> parse_released_config(std::string_view text, const JsonLimits& limits = {});

/// A request and how its file says it, for the addresses of errors that come up later.
struct RequestFile {
  EditRequest request;
  std::string name;       ///< Name of the request among several; empty if the file holds one.
  bool released = false;  ///< The file is a released 3DGS-Drag configuration.

  /// What the file calls a field of the request: "ear_up.handles[2].radius", or "voxel_size" in a released
  /// configuration.
  [[nodiscard]] std::string address_of(std::string_view field) const;
};

/// Decodes a file of either form, or of several requests by name ({"ear_up": {...}, "comment": "..."}; members that are
/// strings are comments).
///   name    which of several; empty: the file holds one
///   errors  as parse_edit_request(), with the name before the address ("ear_up.handles[2].radius");
///           invalid_argument: several and no name, or a name and one; not_found: no request of that name. The message
///           lists the names there are.
[[nodiscard]] Result<RequestFile> parse_request_file(std::string_view text, std::string_view name,
                                                     const JsonLimits& limits = {});

/// Decodes what a person has at hand of a selection: {"selection": [...]}, the list alone, or an edit request, of which
/// all is checked and the selection is taken; nothing has to move in it. Also of several by name, as above.
///   errors  as parse_selection(), also of a list ("selection[2]..."), and those of a name; invalid_argument: a request
///           that selects nothing, a name and a list
[[nodiscard]] Result<Selection> parse_selection_file(std::string_view text, std::string_view name = {},
                                                     const JsonLimits& limits = {});

/// The request as indented JSON that parse_edit_request() reads back; what is not given is left out.
[[nodiscard]] std::string to_json(const EditRequest& request);

}  // namespace proto
