#include "server/http/call.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include "engine/core/file_descriptor.h"
#include "server/http/negotiation.h"

namespace server::http {

using engine::ErrorCode;

namespace {

engine::Error body_error(const Connection& connection) {
  switch (connection.body_failure()) {
    case Connection::BodyFailure::too_slow:
      return {ErrorCode::unavailable, "the request's body arrived too slowly", ""};
    case Connection::BodyFailure::malformed:
      return {ErrorCode::invalid_argument, "the request's body breaks the rules of chunked transfer", ""};
    default:
      return {ErrorCode::invalid_argument, "the request's body ended before its end", ""};
  }
}

engine::Error limit_error(std::uint64_t limit, const std::string& option) {
  return {ErrorCode::too_large,
          "the request's body may have " + std::to_string(limit) + " bytes; the service's option " + option +
              " sets this limit",
          ""};
}

engine::Error write_error(int error) {
  if (engine::means_no_space(error)) return {ErrorCode::no_space, "the disk is full: the upload was not kept", ""};
  return {ErrorCode::unavailable, std::string("the upload cannot be written: ") + std::strerror(error), ""};
}

}  // namespace

/// A new file, removed again unless it is kept.
class UploadFile {
 public:
  UploadFile(const std::filesystem::path& path, std::uint64_t limit)
      : path_(path), limit_(limit), file_(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)) {
    if (file_.get() < 0) error_ = write_error(errno);
  }
  ~UploadFile() {
    if (file_.get() >= 0 && !kept_) ::unlink(path_.c_str());
  }
  UploadFile(const UploadFile&) = delete;
  UploadFile& operator=(const UploadFile&) = delete;

  [[nodiscard]] const std::optional<engine::Error>& error() const { return error_; }
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }

  bool append(std::string_view data) {
    if (error_) return false;
    bytes_ += data.size();
    if (bytes_ > limit_) return fail(limit_error(limit_, "--max-upload-bytes"));
    while (!data.empty()) {
      const ssize_t written = ::write(file_.get(), data.data(), data.size());
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return fail(write_error(errno));
      data.remove_prefix(std::size_t(written));
    }
    return true;
  }

  bool keep() {
    if (error_) return false;
    if (bytes_ == 0) return fail({ErrorCode::invalid_argument, "the upload is empty", ""});
    if (::fsync(file_.get()) != 0) return fail(write_error(errno));
    return kept_ = true;
  }

  bool fail(engine::Error error) {
    if (!error_) error_ = std::move(error);
    return false;
  }

 private:
  const std::filesystem::path path_;
  const std::uint64_t limit_;
  const engine::FileDescriptor file_;
  std::uint64_t bytes_ = 0;
  bool kept_ = false;
  std::optional<engine::Error> error_;
};

Result<std::string> read_text(Connection& connection, std::uint64_t limit, const std::string& option) {
  std::string text;
  std::array<char, 16 * 1024> piece;
  for (;;) {
    const std::ptrdiff_t got = connection.read_body(piece.data(), piece.size());
    if (got == 0) return text;
    if (got < 0) return tl::make_unexpected(body_error(connection));
    text.append(piece.data(), std::size_t(got));
    if (text.size() > limit) return tl::make_unexpected(limit_error(limit, option));
  }
}

const std::string& HttpCall::path(std::string_view name) const {
  static const std::string none;
  const auto found = fields_.path.find(name);
  return found == fields_.path.end() ? none : found->second;
}

std::optional<std::string> HttpCall::query(std::string_view name) const {
  const auto found = fields_.query.find(name);
  if (found == fields_.query.end()) return std::nullopt;
  return found->second;
}

std::string HttpCall::header(std::string_view name) const { return fields_.head.header(lower_case(name)); }

bool HttpCall::has_header(std::string_view name) const { return fields_.head.count(lower_case(name)) > 0; }

bool HttpCall::has(const std::string& etag) const {
  return fields_.head.only_reads() && names_etag(fields_.head.header("if-none-match"), etag);
}

bool HttpCall::accepts(std::string_view media_type) const {
  return http::accepts(fields_.head.header("accept"), media_type);
}

Result<UploadInfo> HttpCall::receive(const std::filesystem::path& path) const {
  UploadFile file(path, fields_.max_upload_bytes);
  if (file.error()) return tl::make_unexpected(*file.error());
  const bool is_form = media_type_of(fields_.head.header("content-type")) == "multipart/form-data";
  auto received = is_form ? receive_form(file) : receive_raw(file);
  if (!received) return received;
  if (!file.keep()) return tl::make_unexpected(*file.error());
  received->bytes = file.bytes();
  return received;
}

Result<UploadInfo> HttpCall::receive_raw(UploadFile& file) const {
  std::vector<char> piece(256 * 1024);
  for (;;) {
    const std::ptrdiff_t got = fields_.connection.read_body(piece.data(), piece.size());
    if (got == 0) return UploadInfo{};
    if (got < 0) return tl::make_unexpected(body_error(fields_.connection));
    if (!file.append({piece.data(), std::size_t(got)})) return tl::make_unexpected(*file.error());
  }
}

Result<UploadInfo> HttpCall::receive_form(UploadFile& file) const {
  UploadInfo received;
  int files = 0;
  bool in_file = false;
  std::uint64_t other_bytes = 0;
  const auto begin_part = [&](const std::string& filename) {
    in_file = !filename.empty();
    if (!in_file) return true;
    if (++files > 1) return file.fail({ErrorCode::invalid_argument, "the form holds several files; send one", ""});
    received.filename = base_name(filename);
    return true;
  };
  const auto take = [&](std::string_view data) {
    if (in_file) return file.append(data);
    other_bytes += data.size();  // fields beside the file are of no interest, but not for ever
    return other_bytes <= fields_.max_upload_bytes ||
           file.fail(limit_error(fields_.max_upload_bytes, "--max-upload-bytes"));
  };
  const bool whole = fields_.form.read(begin_part, take);
  if (file.error()) return tl::make_unexpected(*file.error());
  if (fields_.connection.body_failure() != Connection::BodyFailure::none)
    return tl::make_unexpected(body_error(fields_.connection));
  if (!whole)
    return engine::fail(ErrorCode::invalid_argument, "the form is malformed, or ends before its last boundary");
  if (files == 0) return engine::fail(ErrorCode::invalid_argument, "the form holds no file");
  return received;
}

}  // namespace server::http
