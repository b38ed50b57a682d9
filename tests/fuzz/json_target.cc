// The bodies of requests, selections among them, and the files of the command line.
#include "proto/edit_request.h"
#include "proto/scene.h"
#include "proto/selection.h"
#include "tests/fuzz/fuzz.h"

void fuzz::run(std::span<const std::byte> bytes) {
  const std::string_view text = text_of(bytes);
  if (const auto request = proto::parse_edit_request(text))
    demand(proto::parse_edit_request(proto::to_json(*request)).has_value(), "a request that is accepted can be stored");
  if (const auto selection = proto::parse_selection(text))
    demand(proto::parse_selection(proto::to_json(*selection)).has_value(),
           "a selection that is accepted can be stored");
  (void)proto::parse_released_config(text);
  (void)proto::parse_request_file(text, "drag.json");
  (void)proto::parse_scene_source(text);
  (void)proto::parse_dataset_source(text);
  (void)proto::parse_scene_patch(text);
}

std::vector<std::string> fuzz::seeds() {
  return {
      R"({"scene":"s000001","version":0,"mode":"move","preset":"draft","handles":[{"source":[0,0,0],"target":[1,0,0],"radius":0.5,"group":0}],"region":{"center":[0,0,0],"size":[1,1,1]},"params":{"intervals":2,"seed":1}})",
      R"({"selection":[{"op":"add","sphere":{"center":[0,0,0],"radius":1}},{"op":"subtract","box":{"center":[0,0,0],"size":[1,1,1]}}]})",
      R"({"path":"a.ply","name":"a"})", R"({"name":"b","up":[0,1,0]})"};
}
