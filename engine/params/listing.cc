#include "engine/params/listing.h"

#include <sstream>
#include <vector>

#include "engine/params/params.h"

namespace engine::params {
namespace {

using Names = std::vector<std::string>;

template <class T>
std::string written(const T& value) {
  std::ostringstream out;
  if constexpr (Named<T>)
    out << name_of(value);
  else
    out << std::boolalpha << value;
  return out.str();
}

std::string written(const Names& names) { return names.empty() ? "none" : std::to_string(names.size()); }

std::string values_of(const Parameter<int>& p) {
  return "whole number, " + written(p.range.low) + " to " + written(p.range.high);
}
std::string values_of(const Parameter<double>& p) {
  return "number, " + written(p.range.low) + " to " + written(p.range.high);
}
std::string values_of(const Parameter<bool>&) { return "true or false"; }
std::string values_of(const Parameter<std::uint64_t>&) { return "whole number from 0"; }
std::string values_of(const Parameter<Names>& p) { return "list of at most " + std::to_string(p.range.most); }

template <Named Enum>
std::string values_of(const Parameter<Enum>&) {
  std::string text;
  for (const auto& name : names<Enum>) text += (text.empty() ? "" : " | ") + std::string(name.text);
  return text;
}

template <class T>
std::string default_of(const Parameter<T>& parameter, Preset preset) {
  if constexpr (std::is_same_v<T, int>)
    if (parameter.defaults.of(preset) == 0 && !parameter.range.zero.empty()) return "from the drag";
  return written(parameter.defaults.of(preset));
}

/// "50, draft 24": what most presets say, then those that say something else.
template <class T>
std::string defaults_of(const Parameter<T>& parameter) {
  const std::string usual = default_of(parameter, Preset::standard);
  std::string text = usual;
  for (const auto& preset : names<Preset>)
    if (const std::string own = default_of(parameter, preset.value); own != usual)
      text += "; " + std::string(preset.text) + ": " + own;
  return text;
}

}  // namespace

std::string listing() {
  std::string text = "What \"params\" of a request may hold. Where a preset has its own default, it is named.";
  for_each_parameter([&](const auto& parameter) {
    if (!parameter.on_wire) return;
    text += "\n  " + std::string(parameter.name) + ": " + values_of(parameter);
    if (!parameter.unit.empty()) text += " " + std::string(parameter.unit);
    text += "\n      " + std::string(parameter.meaning) + "\n      Default: " + defaults_of(parameter);
  });
  return text;
}

}  // namespace engine::params
