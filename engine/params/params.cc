#include "engine/params/params.h"

namespace engine::params {
namespace {

/// 16384, but 1,000,000.
std::string written(int value) {
  std::string digits = std::to_string(value);
  if (value >= 100'000)
    for (int i = int(digits.size()) - 3; i > 0; i -= 3) digits.insert(std::size_t(i), ",");
  return digits;
}

/// Each of these: what is wrong with the value; empty if nothing is.
std::string complaint(const Parameter<int>& parameter, int value) {
  const Range<int>& range = parameter.range;
  if (value >= range.low && value <= range.high) return {};
  if (value == 0 && !range.zero.empty()) return {};
  std::string text = std::string(parameter.noun) + " is " + written(range.low) + " to " + written(range.high);
  if (!parameter.unit.empty()) text += " " + std::string(parameter.unit);
  if (!range.zero.empty()) text += ", or 0 to " + std::string(range.zero);
  return text + ", not " + std::to_string(value);
}

std::string complaint(const Parameter<double>& parameter, double value) {
  if (value >= parameter.range.low && value <= parameter.range.high) return {};  // false for NaN
  return std::string(parameter.noun) + " is a number from " + std::to_string(int(parameter.range.low)) + " to " +
         std::to_string(int(parameter.range.high));
}

std::string complaint(const Parameter<std::vector<std::string>>& parameter, const std::vector<std::string>& value) {
  if (value.size() <= parameter.range.most) return {};
  return std::string(parameter.name) + " has " + std::to_string(value.size()) + " elements; at most " +
         std::to_string(parameter.range.most) + " are allowed";
}

template <class T>
std::string complaint(const Parameter<T>&, const T&) {
  return {};  // what the type holds is right
}

}  // namespace

Params::Params() {
  for_each_parameter([&](const auto& parameter) { this->*parameter.value = parameter.defaults.usual; });
}

Params filled_in(const GivenParams& given, Preset preset) {
  Params params;
  for_each_parameter([&](const auto& parameter) {
    params.*parameter.value = (given.*parameter.given).value_or(parameter.defaults.of(preset));
  });
  return params;
}

GivenParams as_given(const Values& values) {
  GivenParams given;
  for_each_parameter([&](const auto& parameter) {
    if (parameter.on_wire) given.*parameter.given = values.*parameter.value;
  });
  return given;
}

int preset_intervals(Preset preset, const DragKind& drag) {
  // A part that is drawn out leaves its trail where its intervals end: as many as the length of the drag asks for.
  if (!drag.extends && preset == Preset::draft) return 1;
  if (!drag.extends && preset == Preset::standard) return drag.one_piece ? 1 : 4;
  return filled_in({}, preset).intervals;
}

Interpolation preset_interpolation(Preset preset, const DragKind& drag) {
  const Interpolation usual = filled_in({}, preset).interpolation;
  if (preset == Preset::paper) return usual;
  return drag.turns || drag.selected ? Interpolation::arap : usual;
}

Result<void> validate(const Values& values) {
  std::string message, where;
  for_each_parameter([&](const auto& parameter) {
    if (!message.empty()) return;
    message = complaint(parameter, values.*parameter.value);
    where = "params." + std::string(parameter.name);
  });
  if (!message.empty()) return fail(ErrorCode::invalid_argument, std::move(message), std::move(where));
  return {};
}

}  // namespace engine::params
