#include "server/cli/bench_edit.h"

#include <cstdint>

#include "engine/evaluate/result_key.h"
#include "engine/io/image_file.h"
#include "engine/params/params.h"
#include "server/edits/convert.h"

namespace server::cli {
namespace {

namespace edit = engine::edit;
namespace evaluate = engine::evaluate;
using nlohmann::ordered_json;
using std::filesystem::path;

/// Those parameters that a request could give; which corrector is not one of them here.
ordered_json encode_params(const edit::Params& params) {
  ordered_json out = proto::encode(engine::params::as_given(params));
  out.erase("corrector");
  return out;
}

}  // namespace

void apply(const BenchOptions& options, edit::Request& request) {
  request.params = edits::filled_in(options.given, options.preset, request, request.selected.has_value());
  request.params.local_mask = !options.whole_picture;
}

path cache_file(const BenchOptions& options, const Machine& machine, const std::string& subject,
                const std::string& corrector, const std::string& scene, const std::string& dataset,
                const edit::Request& request, const std::string& lpips, const std::string& repainter) {
  static const std::uint64_t program = evaluate::checksum_of_program();
  const std::string key = evaluate::result_key({.subject = subject,
                                                .corrector = corrector,
                                                .scene = scene,
                                                .dataset = dataset,
                                                .pictures = options.pictures,
                                                .threads = machine.threads,
                                                .simd = machine.simd,
                                                .lpips = lpips,
                                                .repainter = repainter,
                                                .program = program},
                                               request);
  return path(options.out) / "results" / (key + ".json");
}

evaluate::Show picture_writer(const BenchOptions& options) {
  return [&options](const std::string& name, const engine::scene::Image& picture) {
    return engine::io::write_image(path(options.out) / (name + ".png"), picture);
  };
}

ordered_json settings(const BenchOptions& options, const Machine& machine) {
  edit::Request any;
  apply(options, any);
  ordered_json params{{"preset", proto::name_of(options.preset)}};
  params.update(encode_params(any.params));
  if (!options.given.intervals) params["intervals"] = nullptr;  // they depend on the drag
  params["local_mask"] = any.params.local_mask;
  return {{"splatdrag", SPLATDRAG_VERSION},
          {"threads", machine.threads},
          {"simd", machine.simd},
          {"params", std::move(params)}};
}

}  // namespace server::cli
