#include "proto/json_fields.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/json_document.h"

namespace proto {
namespace {

/// A number as a person writes it: 16, 0.5, -1e+12.
std::string written(double value) {
  if (value == std::floor(value) && std::abs(value) < 1e6) return std::to_string(std::int64_t(value));
  return nlohmann::json(value).dump();
}

std::string found(const nlohmann::json& value) {
  if (value.is_object()) return "an object";
  if (value.is_array()) return "an array of " + std::to_string(value.size());
  return value.is_string() ? '"' + printable(value.get_ref<const std::string&>()) + '"' : value.dump();
}

}  // namespace

void JsonField::refuse(std::string message) const {
  if (!*error_) *error_ = engine::Error{engine::ErrorCode::invalid_argument, std::move(message), where_};
}

void JsonField::expected(const std::string& what) const { refuse("expected " + what + ", found " + found(*value_)); }

double JsonField::number(double low, double high) const {
  if (value_->is_number()) {
    const double value = value_->get<double>();
    if (value >= low && value <= high) return value;
  }
  expected("a number from " + written(low) + " to " + written(high));
  return low;
}

double JsonField::length() const {
  if (value_->is_number()) {
    const double value = value_->get<double>();
    if (value > 0 && value <= max_coordinate) return value;
  }
  expected("a length above 0, at most 1e12");
  return 1;
}

int JsonField::whole(int low, int high) const {
  if (value_->is_number_integer()) {
    const bool fits = !value_->is_number_unsigned() || value_->get<std::uint64_t>() <= std::uint64_t(high);
    if (fits && value_->get<std::int64_t>() >= low && value_->get<std::int64_t>() <= high) return value_->get<int>();
  }
  expected(high == std::numeric_limits<int>::max()
               ? "a whole number from " + std::to_string(low) + " up"
               : "a whole number from " + std::to_string(low) + " to " + std::to_string(high));
  return low;
}

std::uint64_t JsonField::unsigned_number() const {
  if (value_->is_number_unsigned()) return value_->get<std::uint64_t>();
  expected("a whole number from 0 to 18446744073709551615");
  return 0;
}

bool JsonField::boolean() const {
  if (value_->is_boolean()) return value_->get<bool>();
  expected("true or false");
  return false;
}

std::string JsonField::text(std::size_t max_bytes) const {
  if (value_->is_string() && value_->get_ref<const std::string&>().size() <= max_bytes)
    return value_->get<std::string>();
  expected("a string of at most " + std::to_string(max_bytes) + " bytes");
  return {};
}

Point JsonField::point() const { return numbers<3>(-max_coordinate, max_coordinate); }

Point JsonField::edges() const {
  Point size{1, 1, 1};
  const auto lengths = elements(3, 3, "lengths");
  for (std::size_t i = 0; i < lengths.size(); ++i) size[i] = lengths[i].length();
  return size;
}

std::vector<JsonField> JsonField::elements(std::size_t low, std::size_t high, const std::string& things) const {
  std::vector<JsonField> fields;
  if (!value_->is_array() || value_->size() < low || value_->size() > high) {
    const std::string count = low == high ? std::to_string(low) : std::to_string(low) + " to " + std::to_string(high);
    expected("an array of " + count + " " + things);
    return fields;
  }
  fields.reserve(value_->size());
  for (std::size_t i = 0; i < value_->size(); ++i)
    fields.emplace_back((*value_)[i], where_ + '[' + std::to_string(i) + ']', *error_);
  return fields;
}

Members::Members(const JsonField& object, std::span<const std::string_view> known) : object_(object) {
  if (!object_.is_object()) {
    object_.expected("an object");
    return;
  }
  for (const auto& member : object_.value_->items()) {
    if (std::find(known.begin(), known.end(), member.key()) != known.end()) continue;
    std::string names;
    for (const std::string_view name : known) names += (names.empty() ? "" : ", ") + std::string(name);
    JsonField(member.value(), address(member.key()), *object_.error_).refuse("unknown field; there are " + names);
  }
}

std::optional<JsonField> Members::required(std::string_view name) const {
  auto field = optional(name);
  if (!field && object_.is_object())
    JsonField(*object_.value_, address(name), *object_.error_).refuse("the field is missing");
  return field;
}

std::optional<JsonField> Members::optional(std::string_view name) const {
  if (!object_.is_object()) return std::nullopt;
  const auto member = object_.value_->find(name);
  if (member == object_.value_->end()) return std::nullopt;
  return JsonField(*member, address(name), *object_.error_);
}

std::string Members::address(std::string_view name) const {
  const std::string member = printable(name);
  return object_.where().empty() ? member : object_.where() + '.' + member;
}

}  // namespace proto
