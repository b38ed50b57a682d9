// The words that the formulas of projection.inc and projection_vjp.inc are written in, for plain numbers. For vectors
// of numbers, simd/lanes.inc has the same words.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>

namespace engine::render {

/// What a formula's Real may be: here float or double.
template <class T>
concept Number = std::floating_point<T>;

using std::abs;
using std::clamp;
using std::exp;
using std::max;
using std::sqrt;

/// a b + c. Vectors round once, where the processor can; numbers round twice, as it is written.
template <Number Real>
Real mul_add(Real a, Real b, Real c) {
  return a * b + c;
}
/// a b - c.
template <Number Real>
Real mul_sub(Real a, Real b, Real c) {
  return a * b - c;
}
/// c - a b.
template <Number Real>
Real neg_mul_add(Real a, Real b, Real c) {
  return c - a * b;
}

/// Whether something holds: for one number.
template <Number Real>
using Condition = bool;

/// The value where the condition holds, zero elsewhere.
template <Number Real>
Real where(bool condition, Real value) {
  return condition ? value : Real(0);
}

}  // namespace engine::render
