#include "proto/selection.h"

#include "proto/json_document.h"
#include "proto/json_text.h"
#include "proto/selection_fields.h"

namespace proto {

using engine::propagate;

Result<Selection> parse_selection(std::string_view text, const JsonLimits& limits) {
  const auto document = parse_document(text, limits);
  if (!document) return propagate(document);
  std::optional<engine::Error> error;
  const Members members(JsonField(*document, "", error), {"selection"});
  Selection operations;
  if (const auto f = members.required("selection")) operations = read_selection(*f);
  if (error) return tl::make_unexpected(std::move(*error));
  return operations;
}

std::string to_json(const Selection& selection) { return pretty({{"selection", encode(selection)}}); }

std::string to_json(const SelectionSummary& summary) {
  using nlohmann::ordered_json;
  const auto& at = summary.border;
  const auto border =
      at ? ordered_json{{"wider", at->wider}, {"more", at->more}, {"less", at->less}} : ordered_json(nullptr);
  return pretty({{"id", summary.id},
                 {"count", summary.count},
                 {"bounds", {{"low", summary.low}, {"high", summary.high}}},
                 {"centre", summary.centre},
                 {"undecided", summary.undecided},
                 {"border", border},
                 {"warnings", summary.warnings}});
}

}  // namespace proto
