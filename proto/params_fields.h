// The parameters of an edit in JSON: read, written, and described. All three follow the table in
// engine/params/params.h.
#pragma once

#include <nlohmann/json.hpp>

#include "engine/params/params.h"
#include "proto/edit_request.h"
#include "proto/json_fields.h"

namespace proto {

/// Reads an object of parameters; what it does not hold stays open.
[[nodiscard]] engine::params::GivenParams read_params(const JsonField& field);

/// The object that read_params() reads back: what is given, in the order of the table.
[[nodiscard]] nlohmann::ordered_json encode(const engine::params::GivenParams& params);

/// What a client needs to offer the parameters to a person: a list of
///   name      as in a request                  type     "integer", "number", "boolean", "string" or "array"
///   minimum, maximum                           of the number, or of the elements of the array; else null
///   values    of a string: what it may be; else null
///   unit      of the number; null: none        part     of the edit that it has an effect on
///   defaults  by preset; null: it depends on the drag
///   description
[[nodiscard]] nlohmann::ordered_json describe_parameters();

}  // namespace proto
