#include "observe/camera_off.hpp"

#include <fmt/core.h>

#include <limits>
#include <vector>

namespace trochoid::fitting {
namespace {

using model::ParameterInfo;
using model::Prediction;
using model::PredictRequest;

constexpr const char* kCameraOff = "camera_off[";

class WithCameraOff : public model::Predictor {
 public:
  WithCameraOff(const model::Predictor& plain, Eigen::Index deviations)
      : plain_(plain), infos_(plain.parameters()), own_(static_cast<Eigen::Index>(infos_.size())) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    for (Eigen::Index k = 1; k <= deviations; ++k)
      infos_.push_back({fmt::format("{}{}]", kCameraOff, k), kDeviations,
                        ParameterInfo::Role::observation, -kInfinity, kInfinity, false, 0.0, true,
                        "how far the camera is off in one likely way, in standard deviations"});
  }
  [[nodiscard]] const std::string& model_name() const override { return plain_.model_name(); }
  [[nodiscard]] const std::vector<ParameterInfo>& parameters() const override { return infos_; }
  [[nodiscard]] Prediction predict(const Eigen::Ref<const Eigen::VectorXd>& values,
                                   const PredictRequest& request) const override {
    PredictRequest inner = request;
    std::erase_if(inner.derivatives, [&](int index) { return index >= own_; });
    Prediction out = plain_.predict(values.head(own_), inner);
    if (inner.derivatives.size() == request.derivatives.size()) return out;
    out.jacobian = widened(out.jacobian, request);
    if (request.want_end_state) out.end_state_jacobian = widened(out.end_state_jacobian, request);
    return out;
  }

 private:
  // With columns of zeros for what the model knows nothing of.
  [[nodiscard]] Eigen::MatrixXd widened(const Eigen::MatrixXd& jacobian,
                                        const PredictRequest& request) const {
    Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(jacobian.rows(), std::ssize(request.derivatives));
    Eigen::Index from = 0;
    for (Eigen::Index c = 0; c < wide.cols(); ++c)
      if (request.derivatives[static_cast<std::size_t>(c)] < own_)
        wide.col(c) = jacobian.col(from++);
    return wide;
  }

  const model::Predictor& plain_;
  std::vector<ParameterInfo> infos_;
  Eigen::Index own_;
};

}  // namespace

bool is_camera_off(const std::string& parameter) {
  return parameter.starts_with(kCameraOff);
}

int first_camera_off(const model::Predictor& predictor) {
  return predictor.index_of(fmt::format("{}1]", kCameraOff));
}

std::unique_ptr<model::Predictor> with_camera_off(const model::Predictor& predictor,
                                                  const Eigen::VectorXd& likely,
                                                  data::Scene& scene) {
  auto out = std::make_unique<WithCameraOff>(predictor, likely.size());
  Eigen::Index k = 0;
  for (const ParameterInfo& info : out->parameters()) {
    if (!is_camera_off(info.name)) continue;
    scene.fit.prior[info.name] = {likely[k++], 1.0};
    if (!scene.fit.free.empty()) scene.fit.free.push_back(info.name);
  }
  return out;
}

}  // namespace trochoid::fitting
