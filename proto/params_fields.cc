#include "proto/params_fields.h"

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace proto {
namespace {

using engine::Named;
using engine::params::GivenParams;
using engine::params::Parameter;
using engine::params::Preset;
using engine::params::Range;
using nlohmann::ordered_json;
using Names = std::vector<std::string>;

int read(const JsonField& field, const Range<int>& range) { return field.whole(range.low, range.high); }
double read(const JsonField& field, const Range<double>& range) { return field.number(range.low, range.high); }
bool read(const JsonField& field, const Range<bool>&) { return field.boolean(); }
std::uint64_t read(const JsonField& field, const Range<std::uint64_t>&) { return field.unsigned_number(); }

Names read(const JsonField& field, const Range<Names>& range) {
  Names read;
  for (const JsonField& name : field.elements(0, range.most, "names of views")) read.push_back(name.text());
  return read;
}

template <Named Enum>
Enum read(const JsonField& field, const Range<Enum>&) {
  return field.one_of(engine::names<Enum>);
}

template <class T>
ordered_json encode_value(const T& value) {
  if constexpr (Named<T>)
    return engine::name_of(value);
  else
    return value;
}

/// What the type of a parameter says about its values.
struct Kind {
  const char* type;
  ordered_json minimum = nullptr, maximum = nullptr, values = nullptr;
};

Kind kind_of(const Parameter<int>& p) { return {"integer", p.range.low, p.range.high}; }
Kind kind_of(const Parameter<double>& p) { return {"number", p.range.low, p.range.high}; }
Kind kind_of(const Parameter<bool>&) { return {"boolean"}; }
Kind kind_of(const Parameter<std::uint64_t>&) { return {"integer", 0u, std::numeric_limits<std::uint64_t>::max()}; }
Kind kind_of(const Parameter<Names>& p) { return {"array", 0, p.range.most}; }

template <Named Enum>
Kind kind_of(const Parameter<Enum>&) {
  Kind kind{"string"};
  for (const auto& name : engine::names<Enum>) kind.values.push_back(name.text);
  return kind;
}

template <class T>
ordered_json default_of(const Parameter<T>& parameter, Preset preset) {
  const T& value = parameter.defaults.of(preset);
  if constexpr (std::is_same_v<T, int>)
    if (value == 0 && !parameter.range.zero.empty()) return nullptr;
  return encode_value(value);
}

template <class T>
ordered_json description_of(const Parameter<T>& parameter) {
  Kind kind = kind_of(parameter);
  ordered_json defaults = ordered_json::object();
  for (const auto& preset : engine::names<Preset>)
    defaults[std::string(preset.text)] = default_of(parameter, preset.value);
  return {{"name", parameter.name},
          {"type", kind.type},
          {"minimum", std::move(kind.minimum)},
          {"maximum", std::move(kind.maximum)},
          {"values", std::move(kind.values)},
          {"unit", parameter.unit.empty() ? ordered_json(nullptr) : ordered_json(parameter.unit)},
          {"part", engine::name_of(parameter.part)},
          {"defaults", std::move(defaults)},
          {"description", parameter.meaning}};
}

}  // namespace

GivenParams read_params(const JsonField& field) {
  const Members members(field, engine::params::wire_names);
  GivenParams params;
  engine::params::for_each_parameter([&](const auto& parameter) {
    if (!parameter.on_wire) return;
    if (const auto given = members.optional(parameter.name)) params.*parameter.given = read(*given, parameter.range);
  });
  return params;
}

ordered_json encode(const GivenParams& params) {
  ordered_json out = ordered_json::object();
  engine::params::for_each_parameter([&](const auto& parameter) {
    const auto& value = params.*parameter.given;
    if (parameter.on_wire && value) out[std::string(parameter.name)] = encode_value(*value);
  });
  return out;
}

ordered_json describe_parameters() {
  ordered_json list = ordered_json::array();
  engine::params::for_each_parameter([&](const auto& parameter) {
    if (parameter.on_wire) list.push_back(description_of(parameter));
  });
  return list;
}

}  // namespace proto
