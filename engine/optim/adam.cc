#include "engine/optim/adam.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/core/finite.h"
#include "engine/core/parallel.h"

namespace engine::optim {
namespace {

constexpr std::size_t values_per_chunk = 16384;  // of a parallel task: a choice
constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

/// What a step needs, in float: one rounding of each, so that every element sees the same numbers.
struct StepFactors {
  float keep_first, add_first, keep_second, add_second;
  float second_correction;  ///< 1 / (1 - beta2^t)
  float epsilon;
};

/// All ones in the exponent: NaN or infinity.
inline std::uint32_t is_bad(float x) {
  constexpr std::uint32_t exponent = 0x7f800000u;
  return (std::bit_cast<std::uint32_t>(x) & exponent) == exponent ? 1u : 0u;
}

/// One element; written so that the compiler can take several at once, as are the loops over it.
///   bad  set if the element or a moment of it is not finite any more
inline float moved(float value, float gradient, float& first, float& second, float rate, const StepFactors& f,
                   std::uint32_t& bad) {
  const float m = f.keep_first * first + f.add_first * gradient;
  const float v = f.keep_second * second + f.add_second * (gradient * gradient);
  const float result = value - rate * m / (std::sqrt(v * f.second_correction) + f.epsilon);
  first = m, second = v;
  bad |= is_bad(m) | is_bad(v) | is_bad(result);
  return result;
}

/// Steps rows [begin, end) of a group. False if something in them is not finite any more.
bool step_rows(const AdamGroup& group, std::span<const float> rate, std::size_t begin, std::size_t end,
               const StepFactors& factors, float* first, float* second) {
  float* value = group.value.data();
  const float* gradient = group.gradient.data();
  std::uint32_t bad = 0;
  const std::size_t columns = rate.size();
  if (group.rate.size() == 1 && group.mobility.empty()) {
    for (std::size_t i = begin * columns; i < end * columns; ++i)
      value[i] = moved(value[i], gradient[i], first[i], second[i], rate[0], factors, bad);
    return bad == 0;
  }
  for (std::size_t row = begin; row < end; ++row) {
    const float factor = group.mobility.empty() ? 1.0f : group.mobility[row];
    for (std::size_t k = 0; k < columns; ++k) {
      const std::size_t i = row * columns + k;
      value[i] = moved(value[i], gradient[i], first[i], second[i], factor * rate[k], factors, bad);
    }
  }
  return bad == 0;
}

std::size_t rows_per_chunk(std::size_t columns) { return std::max<std::size_t>(values_per_chunk / columns, 1); }

}  // namespace

Result<void> validate(const AdamOptions& options) {
  if (!(options.beta1 >= 0 && options.beta1 < 1))
    return fail(ErrorCode::invalid_argument, "beta1 must be 0 or more and below 1.", "beta1");
  if (!(options.beta2 >= 0 && options.beta2 < 1))
    return fail(ErrorCode::invalid_argument, "beta2 must be 0 or more and below 1.", "beta2");
  if (!(float(options.epsilon) > 0 && std::isfinite(float(options.epsilon))))
    return fail(ErrorCode::invalid_argument, "epsilon must be above 0 (in float).", "epsilon");
  return {};
}

Adam::Adam(std::vector<AdamLayout> layout, std::size_t rows, const AdamOptions& options)
    : options_(options), rows_(rows) {
  assert(validate(options));
  for (AdamLayout& group : layout) {
    assert(group.columns > 0);
    const std::size_t values = rows * group.columns;
    groups_.push_back({std::move(group), std::vector<float>(values), std::vector<float>(values)});
  }
  fit_buffers();
}

void Adam::fit_buffers() {
  std::size_t columns = 0, chunks = 0;
  for (const Moments& group : groups_) {
    columns = std::max(columns, group.layout.columns);
    chunks = std::max(chunks, chunk_count(rows_, rows_per_chunk(group.layout.columns)));
  }
  rate_.resize(columns);
  bad_.resize(chunks);
}

Result<void> Adam::step(std::span<const AdamGroup> groups) {
  assert(groups.size() == groups_.size());
  ++steps_;
  const double correction1 = 1 / (1 - std::pow(options_.beta1, double(steps_)));
  const double correction2 = 1 / (1 - std::pow(options_.beta2, double(steps_)));
  const StepFactors factors{float(options_.beta1),     float(1 - options_.beta1), float(options_.beta2),
                            float(1 - options_.beta2), float(correction2),        float(options_.epsilon)};
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const AdamGroup& group = groups[g];
    Moments& moments = groups_[g];
    const std::size_t columns = moments.layout.columns, grain = rows_per_chunk(columns);
    assert(group.value.size() == rows_ * columns && group.gradient.size() == rows_ * columns);
    assert(group.rate.size() == 1 || group.rate.size() == columns);
    assert(group.mobility.empty() || group.mobility.size() == rows_);
    for (std::size_t k = 0; k < columns; ++k)
      rate_[k] = float(group.rate[group.rate.size() == 1 ? 0 : k] * correction1);
    parallel_for(rows_, grain, [&](std::size_t begin, std::size_t end) {
      bad_[begin / grain] = none;
      if (step_rows(group, std::span(rate_).first(columns), begin, end, factors, moments.first.data(),
                    moments.second.data()))
        return;
      const std::size_t first = begin * columns, n = (end - begin) * columns;
      std::size_t bad = none;
      for (const std::span<const float> values :
           {std::span<const float>(group.value), std::span<const float>(moments.first),
            std::span<const float>(moments.second)})
        if (const auto at = first_not_finite(values.subspan(first, n))) bad = std::min(bad, first + *at);
      bad_[begin / grain] = bad;
    });
    std::size_t bad = none;
    for (std::size_t chunk = 0; chunk < chunk_count(rows_, grain); ++chunk) bad = std::min(bad, bad_[chunk]);
    if (bad != none) return poisoned(moments.layout, bad, first_not_finite(group.gradient.subspan(bad, 1)).has_value());
  }
  return {};
}

tl::unexpected<Error> Adam::poisoned(const AdamLayout& layout, std::size_t index, bool by_gradient) const {
  std::string where = "[" + std::to_string(index / layout.columns) + "]." + layout.name;
  if (layout.columns > 1) where += "[" + std::to_string(index % layout.columns) + "]";
  const std::string what =
      by_gradient ? "The gradient is not a finite number" : "The parameter or its moments overflowed";
  return fail(ErrorCode::internal, what + " at optimisation step " + std::to_string(steps_) + ".", std::move(where));
}

void Adam::keep_rows(std::span<const std::uint8_t> keep) {
  assert(keep.size() == rows_);
  std::size_t kept = 0;
  for (const std::uint8_t flag : keep) kept += flag != 0 ? 1 : 0;
  for (Moments& group : groups_) {
    const std::size_t columns = group.layout.columns;
    for (std::vector<float>* values : {&group.first, &group.second}) {
      auto to = values->begin();
      for (std::size_t row = 0; row < rows_; ++row)
        if (keep[row] != 0) to = std::copy_n(values->begin() + std::ptrdiff_t(row * columns), columns, to);
      values->resize(kept * columns);
    }
  }
  rows_ = kept;
  fit_buffers();
}

void Adam::append_rows(std::size_t count) {
  rows_ += count;
  for (Moments& group : groups_) {
    group.first.resize(rows_ * group.layout.columns);
    group.second.resize(rows_ * group.layout.columns);
  }
  fit_buffers();
}

void Adam::write(ByteWriter& out) const {
  out.write(std::uint64_t(rows_));
  out.write(steps_);
  for (const Moments& group : groups_) {
    out.write_all(std::span<const float>(group.first));
    out.write_all(std::span<const float>(group.second));
  }
}

void Adam::read(ByteReader& in) {
  if (in.read<std::uint64_t>() != rows_) in.fail();
  steps_ = in.read<std::uint64_t>();
  for (Moments& group : groups_) {
    in.read_all(std::span(group.first));
    in.read_all(std::span(group.second));
  }
}

}  // namespace engine::optim
