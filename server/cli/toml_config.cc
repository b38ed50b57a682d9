#include "server/cli/toml_config.h"

#include <toml++/toml.h>

#include <cstdlib>
#include <istream>
#include <sstream>

namespace server::cli {
namespace {

/// As it would stand on the command line.
std::string text_of(const toml::node& value, const std::string& key) {
  if (const auto* text = value.as_string()) return text->get();
  std::ostringstream out;
  if (const auto* number = value.as_integer())
    out << number->get();
  else if (const auto* real = value.as_floating_point())
    out << toml::node_view(*real);
  else if (const auto* flag = value.as_boolean())
    out << (flag->get() ? "true" : "false");
  else
    throw CLI::ConfigError("the setting " + key + " is neither a text, a number, true or false nor a list of those");
  return out.str();
}

bool in_environment(const CLI::Option& option) {
  const char* value = option.get_envname().empty() ? nullptr : std::getenv(option.get_envname().c_str());
  return value != nullptr && *value != '\0';  // empty counts as not set, as in CLI11
}

void collect(const toml::table& table, const CLI::App& command, const std::vector<std::string>& parents,
             std::vector<CLI::ConfigItem>& items) {
  for (const auto& [name, value] : table) {
    CLI::ConfigItem item;
    item.parents = parents;
    item.name = name.str();
    const std::string key = item.fullname();
    if (const toml::table* inner = value.as_table()) {
      const auto commands = command.get_subcommands([&](const CLI::App* sub) { return sub->get_name() == item.name; });
      if (commands.empty()) throw CLI::ConfigError("there is no subcommand for the table [" + key + "]");
      auto inner_parents = parents;
      inner_parents.push_back(item.name);
      collect(*inner, *commands.front(), inner_parents, items);
      continue;
    }
    const CLI::Option* const option = command.get_option_no_throw("--" + item.name);
    if (option == nullptr || !option->get_configurable()) throw CLI::ConfigError("unknown setting " + key);
    if (in_environment(*option)) continue;
    if (const toml::array* list = value.as_array())
      for (const toml::node& element : *list) item.inputs.push_back(text_of(element, key));
    else
      item.inputs.push_back(text_of(value, key));
    items.push_back(std::move(item));
  }
}

}  // namespace

std::vector<CLI::ConfigItem> TomlConfig::from_config(std::istream& input) const {
  std::vector<CLI::ConfigItem> settings;
  try {
    collect(toml::parse(input), program_, {}, settings);
  } catch (const toml::parse_error& error) {
    const auto& place = error.source().begin;
    throw CLI::ConfigError("the settings file is not TOML: " + std::string(error.description()) + " (line " +
                           std::to_string(place.line) + ", column " + std::to_string(place.column) + ")");
  }
  return settings;
}

}  // namespace server::cli
