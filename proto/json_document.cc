#include "proto/json_document.h"

#include <algorithm>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace proto {
namespace {

using engine::Error;
using engine::ErrorCode;
using engine::fail;
using nlohmann::json;

constexpr int number_overflows = 406;  // nlohmann's id of that error

/// "line 3, column 7" of a byte offset.
std::string line_and_column(std::string_view text, std::size_t offset) {
  const std::string_view before = text.substr(0, std::min(offset, text.size()));
  const auto line = std::count(before.begin(), before.end(), '\n') + 1;
  const std::size_t line_begin = before.rfind('\n') + 1;  // npos + 1 is 0
  return "line " + std::to_string(line) + ", column " +
         std::to_string(std::max<std::size_t>(before.size() - line_begin, 1));
}

/// What the parser found wrong, without its own name and numbers in front.
std::string complaint(std::string_view what) {
  const std::size_t place = what.find("column ");
  const std::size_t colon = what.find(": ", place == std::string_view::npos ? 0 : place);
  return std::string(colon == std::string_view::npos ? what : what.substr(colon + 2));
}

/// Builds the document as the parser walks the text, and knows the address of where it is.
class Builder final : public nlohmann::json_sax<json> {
 public:
  Builder(std::string_view text, const JsonLimits& limits) : text_(text), limits_(limits) {}

  bool null() override { return put(nullptr); }
  bool boolean(bool value) override { return put(value); }
  bool number_integer(number_integer_t value) override { return put(value); }
  bool number_unsigned(number_unsigned_t value) override { return put(value); }
  bool number_float(number_float_t value, const string_t&) override { return put(value); }
  bool string(string_t& value) override { return put(std::move(value)); }
  bool binary(binary_t&) override { return stop(ErrorCode::invalid_argument, "binary data is not JSON", address()); }
  bool start_object(std::size_t) override { return open(json::object()); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }

  bool key(string_t& name) override {
    Level& level = levels_.back();
    level.key = name;
    if (!level.value->contains(name)) return true;
    return stop(ErrorCode::invalid_argument, "the field is given twice", address());
  }

  bool parse_error(std::size_t position, const std::string&, const json::exception& failure) override {
    if (failure.id == number_overflows)
      return stop(ErrorCode::invalid_argument, "the number is too large to be represented", address());
    return stop(ErrorCode::invalid_argument, "not valid JSON: " + complaint(failure.what()),
                line_and_column(text_, position));
  }

  [[nodiscard]] Result<json> take() {
    if (error_) return tl::make_unexpected(std::move(*error_));
    return std::move(root_);
  }

 private:
  struct Level {
    json* value;
    std::string key;  // of the member being read, if value is an object
  };

  /// A value that is complete, or has just been opened: goes where we are.
  json* place(json value) {
    if (levels_.empty()) {
      root_ = std::move(value);
      return &root_;
    }
    Level& level = levels_.back();
    if (level.value->is_object()) return &((*level.value)[level.key] = std::move(value));
    level.value->push_back(std::move(value));
    return &level.value->back();
  }

  bool put(json value) {
    place(std::move(value));
    return true;
  }

  bool open(json empty) {
    if (int(levels_.size()) == limits_.max_depth)
      return stop(ErrorCode::too_large,
                  "arrays and objects are nested more than " + std::to_string(limits_.max_depth) + " deep", address());
    levels_.push_back({place(std::move(empty)), {}});
    return true;
  }

  bool close() {
    levels_.pop_back();
    return true;
  }

  /// The address of the value that comes next.
  [[nodiscard]] std::string address() const {
    std::string text;
    for (const Level& level : levels_) {
      if (level.value->is_array())
        text += '[' + std::to_string(level.value->size() - (&level != &levels_.back())) + ']';
      else
        text += (text.empty() ? "" : ".") + printable(level.key);
    }
    return text;
  }

  bool stop(ErrorCode code, std::string message, std::string where) {
    error_ = Error{code, std::move(message), std::move(where)};
    return false;
  }

  std::string_view text_;
  JsonLimits limits_;
  json root_;
  std::vector<Level> levels_;
  std::optional<Error> error_;
};

constexpr std::size_t max_printable = 60;  // characters

}  // namespace

std::string printable(std::string_view text) {
  const std::string quoted =
      json(text).dump(-1, ' ', /*ensure_ascii=*/true, json::error_handler_t::replace);  // text may not be UTF-8
  const std::string escaped = quoted.substr(1, quoted.size() - 2);
  return escaped.size() <= max_printable ? escaped : escaped.substr(0, max_printable) + "...";
}

Result<json> parse_document(std::string_view text, const JsonLimits& limits) {
  if (text.size() > limits.max_bytes)
    return fail(ErrorCode::too_large, "the document has " + std::to_string(text.size()) + " bytes; the limit is " +
                                          std::to_string(limits.max_bytes));
  try {
    Builder builder(text, limits);
    json::sax_parse(text.begin(), text.end(), &builder);  // its answer repeats what the builder knows
    return builder.take();
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::too_large, "the document does not fit into the memory of this machine");
  }
}

}  // namespace proto
