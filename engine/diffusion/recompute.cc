#include "engine/diffusion/recompute.h"

#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/empty.h>
#include <torch/csrc/autograd/custom_function.h>
#include <torch/custom_class.h>

#include <utility>

namespace engine::diffusion {
namespace {

namespace autograd = torch::autograd;

/// A part as libtorch keeps it until the way back.
struct KeptPart final : torch::CustomClassHolder {
  explicit KeptPart(Part kept) : part(std::move(kept)) {}
  Part part;
};

struct Recomputed final : autograd::Function<Recomputed> {
  /// anchor  a parameter of no use: an output is given gradients only if an argument has some, and those of the
  ///         network's own parameters are none of its arguments
  static Tensor forward(autograd::AutogradContext* kept, const Part& part, const Tensor& /*anchor*/, const Tensor& x,
                        const Tensor& context) {
    kept->saved_data["part"] = at::IValue::make_capsule(c10::make_intrusive<KeptPart>(part));
    kept->save_for_backward({x, context});
    return part(x, context);
  }

  static autograd::variable_list backward(autograd::AutogradContext* kept, const autograd::variable_list& v_out) {
    const auto held = kept->saved_data["part"].toCapsule();
    const Part& part = static_cast<const KeptPart&>(*held).part;
    autograd::variable_list inputs;
    for (const Tensor& saved : kept->get_saved_variables())
      inputs.push_back(saved.detach().requires_grad_(saved.requires_grad()));
    const at::AutoGradMode gradients(true);
    const Tensor out = part(inputs[0], inputs[1]);
    if (out.requires_grad()) out.backward(v_out[0]);
    return {Tensor(), Tensor(), inputs[0].grad(), inputs[1].grad()};
  }
};

}  // namespace

Tensor recomputed(const Part& part, const Tensor& x, const Tensor& context) {
  if (!at::GradMode::is_enabled()) return part(x, context);
  return Recomputed::apply(part, at::empty({0}, at::kFloat).requires_grad_(), x, context);
}

}  // namespace engine::diffusion
