#include "engine/evaluate/result_key.h"

#include <fstream>
#include <iomanip>
#include <iterator>
#include <limits>
#include <span>
#include <sstream>
#include <type_traits>
#include <vector>

#include "engine/core/checksum.h"
#include "engine/params/params.h"

namespace engine::evaluate {
namespace {

std::uint64_t checksum(const std::string& text) { return fnv1a(std::as_bytes(std::span(text))); }

/// Fields one after the other, so that no two lists of them read the same: texts are quoted, numbers have all digits.
class Fields {
 public:
  Fields() { out_ << std::setprecision(std::numeric_limits<double>::max_digits10); }
  void add(const std::string& text) { out_ << std::quoted(text) << ','; }
  void add(const std::vector<std::string>& list) {
    add(list.size());
    for (const std::string& text : list) add(text);
  }
  template <class T>
  void add(T value) {
    if constexpr (std::is_enum_v<T>)
      out_ << int(value) << ',';
    else
      out_ << value << ',';
  }
  void add(DVec3 v) {
    for (int axis = 0; axis < 3; ++axis) add(v[axis]);
  }
  [[nodiscard]] std::string text() const { return out_.str(); }

 private:
  std::ostringstream out_;
};

void add(const edit::Params& values, Fields& fields) {
  params::for_each_parameter([&](const auto& parameter) {
    if (parameter.name != "corrector") fields.add(values.*parameter.value);  // which one is tried stands in ResultOf
  });
}

}  // namespace

std::string result_key(const ResultOf& of, const edit::Request& request) {
  Fields fields;
  for (const std::string* text :
       {&of.subject, &of.corrector, &of.scene, &of.dataset, &of.simd, &of.lpips, &of.repainter})
    fields.add(*text);
  fields.add(of.pictures);
  fields.add(of.threads);
  fields.add(of.program);
  add(request.params, fields);
  fields.add(int(request.mode));
  for (const edit::Handle& handle : request.handles) {
    fields.add(handle.radius);
    fields.add(handle.group);
    fields.add(handle.target.has_value());
    fields.add(handle.source);
    fields.add(handle.end());
    fields.add(handle.rotation.has_value());
    const DQuat turn = handle.rotation.value_or(DQuat(1, 0, 0, 0));
    for (const double value : {turn.w, turn.x, turn.y, turn.z, handle.scale.value_or(1)}) fields.add(value);
  }
  fields.add(int(request.attach));
  fields.add(request.selected.has_value());
  if (request.selected)
    for (const std::uint32_t row : *request.selected) fields.add(row);
  if (request.region) {
    fields.add(request.region->center);
    fields.add(request.region->size);
  }
  std::ostringstream key;
  key << of.subject << '-' << of.corrector << '-' << std::hex << std::setfill('0') << std::setw(16)
      << checksum(fields.text());
  return key.str();
}

std::uint64_t checksum_of_program() {
  std::ifstream file("/proc/self/exe", std::ios::binary);
  return checksum({std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()});
}

}  // namespace engine::evaluate
