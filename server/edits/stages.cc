#include "server/edits/stages.h"

namespace server::edits {

std::string_view name_of(JobStage stage) { return stage == JobStage::load ? "load" : "publish"; }

std::vector<std::string_view> stage_names() {
  std::vector<std::string_view> names{name_of(JobStage::load)};
  for (std::size_t k = 0; k < engine::edit::stage_count; ++k)
    names.push_back(engine::edit::name_of(engine::edit::Stage(k)));
  names.push_back(name_of(JobStage::publish));
  return names;
}

}  // namespace server::edits
