#include "server/edits/stages.h"

namespace server::edits {

std::vector<std::string_view> stage_names() {
  std::vector<std::string_view> names{name_of(JobStage::load)};
  for (const auto& stage : engine::names<engine::edit::Stage>) names.push_back(stage.text);
  names.push_back(name_of(JobStage::publish));
  return names;
}

}  // namespace server::edits
