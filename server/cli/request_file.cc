#include "server/cli/request_file.h"

#include "engine/io/read_bytes.h"

namespace server::cli {
namespace {

/// What `parse` makes of a file's text; its errors name the file.
template <class Parse>
auto read_file(const std::filesystem::path& path, Parse parse)
    -> decltype(parse(std::string_view(), proto::JsonLimits())) {
  const proto::JsonLimits limits;
  const auto bytes = engine::io::read_bytes(path, limits.max_bytes);
  if (!bytes) return engine::propagate(bytes);
  auto read = parse(std::string_view(reinterpret_cast<const char*>(bytes->data()), bytes->size()), limits);
  if (!read) {
    std::string& where = read.error().where;
    where = path.filename().string() + (where.empty() ? "" : ":") + where;
  }
  return read;
}

}  // namespace

engine::Result<proto::RequestFile> read_request(const std::filesystem::path& path, const std::string& name) {
  return read_file(path, [&](std::string_view text, const proto::JsonLimits& limits) {
    return proto::parse_request_file(text, name, limits);
  });
}

engine::Result<proto::Selection> read_selection(const std::filesystem::path& path, const std::string& name) {
  return read_file(path, [&](std::string_view text, const proto::JsonLimits& limits) {
    return proto::parse_selection_file(text, name, limits);
  });
}

}  // namespace server::cli
