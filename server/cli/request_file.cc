#include "server/cli/request_file.h"

#include "engine/io/read_bytes.h"

namespace server::cli {

engine::Result<proto::RequestFile> read_request(const std::filesystem::path& path, const std::string& name) {
  const proto::JsonLimits limits;
  const auto bytes = engine::io::read_bytes(path, limits.max_bytes);
  if (!bytes) return engine::propagate(bytes);
  const std::string_view text(reinterpret_cast<const char*>(bytes->data()), bytes->size());
  auto request = proto::parse_request_file(text, name, limits);
  if (!request) {
    std::string& where = request.error().where;
    where = path.filename().string() + (where.empty() ? "" : ":") + where;
  }
  return request;
}

}  // namespace server::cli
