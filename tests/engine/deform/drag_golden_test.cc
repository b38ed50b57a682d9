// The paper's formulas against reference vectors, in double: abs 1e-12 (drag.safetensors in the manifest).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "engine/deform/deform.h"
#include "engine/deform/motion.h"
#include "tests/support/data.h"
#include "tests/support/safetensors.h"

namespace engine::deform {
namespace {

constexpr double tolerance = 1e-12;
constexpr float float_tolerance = 1e-5f;

struct Case {
  std::string name;
  std::vector<DVec3> handles, targets, means;
  std::vector<DQuat> quats;
  std::vector<int> groups;
  std::vector<Drag> drags;
};

std::vector<DVec3> points(const support::Tensor& tensor) {
  std::vector<DVec3> out;
  for (std::size_t i = 0; i < tensor.values.size(); i += 3)
    out.emplace_back(tensor.values[i], tensor.values[i + 1], tensor.values[i + 2]);
  return out;
}

std::vector<DQuat> quaternions(const support::Tensor& tensor) {
  std::vector<DQuat> out;
  const auto& v = tensor.values;
  for (std::size_t i = 0; i < v.size(); i += 4) out.emplace_back(v[i], v[i + 1], v[i + 2], v[i + 3]);
  return out;
}

Case load(const support::TensorFile& file, const std::string& name) {
  Case c{name,
         points(file.at(name + ".handles")),
         points(file.at(name + ".targets")),
         points(file.at(name + ".means")),
         quaternions(file.at(name + ".quats_wxyz")),
         {},
         {}};
  c.groups.assign(c.handles.size(), 0);
  if (file.contains(name + ".cluster"))
    for (std::size_t i = 0; i < c.groups.size(); ++i) c.groups[i] = int(file.at(name + ".cluster").values[i]);
  for (std::size_t i = 0; i < c.handles.size(); ++i) c.drags.push_back({c.handles[i], c.targets[i], c.groups[i]});
  return c;
}

/// The handle nearest to a point, of whatever group.
std::size_t nearest(const Case& c, DVec3 point) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < c.handles.size(); ++k)
    if (glm::distance(point, c.handles[k]) < glm::distance(point, c.handles[best])) best = k;
  return best;
}

double difference(DVec3 a, DVec3 b) {
  const DVec3 d = glm::abs(a - b);
  return std::max({d.x, d.y, d.z});
}

/// Largest difference of a component; q and -q are one rotation, so `up_to_sign` takes the better of the two.
double difference(const DQuat& a, const DQuat& b, bool up_to_sign) {
  const auto worst = [&](double sign) {
    return std::max({std::abs(a.w - sign * b.w), std::abs(a.x - sign * b.x), std::abs(a.y - sign * b.y),
                     std::abs(a.z - sign * b.z)});
  };
  return up_to_sign ? std::min(worst(1), worst(-1)) : worst(1);
}

class DragGolden : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const auto path = support::golden_dir() / "drag.safetensors";
    REQUIRE_SHARED(path);
    file_.emplace(path);
    case_ = load(*file_, GetParam());
  }
  std::optional<support::TensorFile> file_;
  Case case_;
};

TEST_P(DragGolden, NeighboursAndWeightsOfHandlesAndGaussians) {
  const auto compare = [&](const std::string& nn_name, const std::string& w_name, std::size_t i, const Nearby& found) {
    const auto& nn = file_->at(case_.name + nn_name).values;
    const auto& w = file_->at(case_.name + w_name).values;
    for (std::size_t slot = 0; slot < 2; ++slot) {
      EXPECT_EQ(found.handle[slot], int(nn[2 * i + slot])) << nn_name << " " << i << " " << slot;
      EXPECT_NEAR(found.weight[slot], w[2 * i + slot], tolerance) << w_name << " " << i << " " << slot;
    }
  };
  const auto handles = handle_motions(case_.drags, Rotation::none);
  for (std::size_t i = 0; i < case_.handles.size(); ++i)
    compare(".handle_nn", ".handle_w", i, nearby(case_.handles[i], handles, case_.groups[i], int(i)));
  for (std::size_t i = 0; i < case_.means.size(); ++i)
    compare(".gauss_nn", ".gauss_w", i, nearby(case_.means[i], handles, case_.groups[nearest(case_, case_.means[i])]));
}

TEST_P(DragGolden, RotationsAndMotions) {
  for (const auto& [variant, rotation] :
       {std::pair{"literal", Rotation::paper}, std::pair{"shortest", Rotation::shortest_arc}}) {
    SCOPED_TRACE(variant);
    const std::string prefix = case_.name + "." + variant + ".";
    // The axis of an exact half turn is a convention, so the vectors that depend on it are not compared.
    const bool compare_axes = !(case_.name == "antiparallel" && rotation == Rotation::shortest_arc);

    const auto pair_q = quaternions(file_->at(prefix + "pair_q"));
    const auto& nn = file_->at(case_.name + ".handle_nn").values;
    for (std::size_t i = 0; i < case_.handles.size(); ++i) {
      for (std::size_t slot = 0; slot < 2; ++slot) {
        if (nn[2 * i + slot] < 0) continue;
        const auto k = std::size_t(nn[2 * i + slot]);
        const DVec3 v_h = case_.handles[k] - case_.handles[i], v_t = case_.targets[k] - case_.targets[i];
        const DQuat q = pair_rotation(v_h, v_t, rotation);
        if (compare_axes) {
          EXPECT_LT(difference(q, pair_q[2 * i + slot], true), tolerance) << "pair_q " << i << " " << slot;
        } else {
          EXPECT_NEAR(q.w, 0, tolerance);
          EXPECT_LT(difference(q * glm::normalize(v_h), glm::normalize(v_t)), tolerance);
        }
      }
    }

    const auto motions = handle_motions(case_.drags, rotation);
    const auto handle_dq = quaternions(file_->at(prefix + "handle_dq"));
    for (std::size_t i = 0; i < motions.size(); ++i) {
      if (!compare_axes) continue;
      EXPECT_LT(difference(motions[i].rotation, handle_dq[i], true), tolerance) << "handle_dq " << i;
    }

    const auto gauss_dq = quaternions(file_->at(prefix + "gauss_dq"));
    const auto means_out = points(file_->at(prefix + "means_out"));
    const auto quats_out = quaternions(file_->at(prefix + "quats_out"));
    for (std::size_t i = 0; i < case_.means.size(); ++i) {
      const int group = case_.groups[nearest(case_, case_.means[i])];
      const GaussianMotion motion = gaussian_motion(case_.means[i], motions, group, Interpolation::paper);
      EXPECT_LT(difference(motion.mean, means_out[i]), tolerance) << "means_out " << i;
      if (!compare_axes) continue;
      EXPECT_LT(difference(motion.rotation, gauss_dq[i], true), tolerance) << "gauss_dq " << i;
      const double norm = std::max(1.0, glm::length(quats_out[i]));  // case h3_unnormalised goes up to 1e2
      EXPECT_LT(difference(motion.rotation * case_.quats[i], quats_out[i], true), tolerance * norm)
          << "quats_out " << i;
    }
  }
}

TEST_P(DragGolden, RowsOfAFloatCloudFollowToFloatPrecision) {
  scene::GaussianCloud cloud;
  cloud.resize(case_.means.size());
  std::vector<std::uint32_t> rows;
  std::vector<std::uint16_t> owner;
  for (std::size_t i = 0; i < case_.means.size(); ++i) {
    cloud.mean.set(i, Vec3(case_.means[i]));
    cloud.rotation.set(i, Quat(glm::normalize(case_.quats[i])));
    rows.push_back(std::uint32_t(i));
    owner.push_back(std::uint16_t(nearest(case_, case_.means[i]) + 1));
  }
  const auto motions = handle_motions(case_.drags, Rotation::paper);
  const Deformation moved = deformation(cloud, rows, owner, motions, Interpolation::paper);
  const auto means_out = points(file_->at(case_.name + ".literal.means_out"));
  const auto quats_out = quaternions(file_->at(case_.name + ".literal.quats_out"));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    apply(moved, i, true, cloud, i);
    EXPECT_LT(difference(DVec3(cloud.mean.get(i)), means_out[i]), float_tolerance) << i;
    EXPECT_LT(difference(DQuat(cloud.rotation.get(i)), glm::normalize(quats_out[i]), true), float_tolerance) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, DragGolden,
                         testing::Values("h1", "h2", "h3", "h3_rigid60", "h3_unnormalised", "h11_spreadleg",
                                         "h11_spreadleg_clusters", "coincident", "all_coincident", "gaussian_on_handle",
                                         "antiparallel", "over90"));

}  // namespace
}  // namespace engine::deform
