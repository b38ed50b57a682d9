// The Call that handlers see, over a connection.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "server/http/connection.h"
#include "server/http/dispatcher.h"
#include "server/http/route_table.h"
#include "server/http/router.h"

namespace server::http {

/// Reads the rest of a body.
///   limit   most bytes
///   option  name of the limit in messages
///   errors  too_large, invalid_argument: it ended early or its framing is broken
[[nodiscard]] Result<std::string> read_text(Connection& connection, std::uint64_t limit, const std::string& option);

/// One request on its connection. Used by one thread.
class HttpCall final : public Call {
 public:
  /// What the call is made of; references outlive it.
  struct Fields {
    const RequestHead& head;
    const std::string& request_id;
    PathValues path;
    std::map<std::string, std::string, std::less<>> query;
    std::string body;
    bool is_json = false;
    Connection& connection;
    FormReader& form;
    std::uint64_t max_upload_bytes;
    TokenPtr token;
  };
  explicit HttpCall(Fields fields) : fields_(std::move(fields)) {}

  [[nodiscard]] const std::string& request_id() const override { return fields_.request_id; }
  [[nodiscard]] TokenPtr token() const override { return fields_.token; }
  [[nodiscard]] const std::string& path(std::string_view name) const override;
  [[nodiscard]] std::optional<std::string> query(std::string_view name) const override;
  [[nodiscard]] std::string header(std::string_view name) const override;
  [[nodiscard]] bool has_header(std::string_view name) const override;
  [[nodiscard]] const std::string& body() const override { return fields_.body; }
  [[nodiscard]] bool is_json() const override { return fields_.is_json; }
  [[nodiscard]] Result<UploadInfo> receive(const std::filesystem::path& file) const override;
  [[nodiscard]] bool has(const std::string& etag) const override;
  [[nodiscard]] bool gone() const override { return fields_.connection.closed_by_client(); }
  [[nodiscard]] bool accepts(std::string_view media_type) const override;

 private:
  [[nodiscard]] Result<UploadInfo> receive_raw(class UploadFile& file) const;
  [[nodiscard]] Result<UploadInfo> receive_form(class UploadFile& file) const;

  Fields fields_;
};

}  // namespace server::http
