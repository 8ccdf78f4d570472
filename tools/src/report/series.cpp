#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/constants.hpp"
#include "report/parts.hpp"
#include "trochoid/data/angle.hpp"
#include "trochoid/data/quantile.hpp"

namespace trochoid::tools {
namespace {

using nlohmann::json;
constexpr std::size_t kMostRows = 20000;  // a page with more is slow and shows no more

struct SampleRow {
  double t_s;
  const data::TrackSample* sample;  ///< none within a gap
};

// The samples, and the frames missing between them, so that gaps look like gaps.
std::vector<SampleRow> rows_of(const data::Track& track) {
  const double step_s = data::usual_step_s(track.samples, &data::TrackSample::t_s);
  const std::size_t stride = track.samples.size() / kMostRows + 1;
  std::vector<SampleRow> rows;
  for (std::size_t i = 0; i < track.samples.size(); i += stride) {
    if (i > 0 && stride == 1) {
      const double from_s = track.samples[i - 1].t_s, length_s = track.samples[i].t_s - from_s;
      const int missing = std::min(1000, static_cast<int>(std::lround(length_s / step_s)) - 1);
      for (int k = 1; k <= missing; ++k)
        rows.push_back({from_s + length_s * k / (missing + 1), nullptr});
    }
    rows.push_back({track.samples[i].t_s, &track.samples[i]});
  }
  return rows;
}

// Six digits are finer than any plot; null where there is no value.
json number(double value) {
  if (!std::isfinite(value)) return nullptr;
  if (value == 0.0) return 0;
  const double unit = std::pow(10.0, 5 - std::floor(std::log10(std::abs(value))));
  return std::round(value * unit) / unit;
}

class ObjectSeries {
 public:
  ObjectSeries(const ReportFacts& facts, std::size_t index)
      : facts_(facts), track_(facts.input.tracks.tracks[index]), rows_(rows_of(track_)) {
    for (const SampleRow& row : rows_)
      poses_.push_back(facts.prediction.at(track_.object, row.t_s));
    arc_ = facts.prediction.arcs.empty() ? nullptr : &facts.prediction.arcs.front();
  }

  [[nodiscard]] json object() const {
    json made;
    made["name"] =
        facts_.input.tracks.tracks.size() > 1 ? "object " + std::to_string(track_.object) : "";
    made["t"] = json::array();
    for (const SampleRow& row : rows_) made["t"].push_back(std::round(row.t_s * 1e7) / 1e7);
    made["path"] = path();
    made["charts"] = json::array();
    for (int axis = 0; axis < 2; ++axis) made["charts"].push_back(position(axis));
    if (arc_ != nullptr && facts_.prediction.angles_alone())
      made["charts"].push_back(spin_residual());
    else if (arc_ != nullptr)
      for (int axis = 0; axis < 2; ++axis) made["charts"].push_back(position_residual(axis));
    for (json& chart : angles()) made["charts"].push_back(std::move(chart));
    for (json& chart : dynamics()) made["charts"].push_back(std::move(chart));
    return made;
  }

 private:
  template <class Value>
  json column(const Value& value) const {
    json values = json::array();
    for (std::size_t i = 0; i < rows_.size(); ++i) values.push_back(number(value(i)));
    return values;
  }
  [[nodiscard]] double seen(std::size_t i, int axis) const {
    if (rows_[i].sample == nullptr) return kNaN;
    if (facts_.metres) return rows_[i].sample->centre_m[axis] * kMmPerM;
    return (axis == 0 ? 1.0 : -1.0) * rows_[i].sample->centre_px[axis];
  }
  [[nodiscard]] double expected(std::size_t i, int axis) const {
    return poses_[i] ? poses_[i]->centre_m[axis] * kMmPerM : kNaN;
  }
  [[nodiscard]] double noise_scale(std::size_t i) const {
    const PredictedArc* arc = facts_.prediction.arc_at(track_.object, rows_[i].t_s);
    return arc != nullptr ? arc->noise_scale : 1.0;
  }
  [[nodiscard]] double sigma_mm(std::size_t i, int axis) const {
    if (rows_[i].sample == nullptr || !rows_[i].sample->has_covariance()) return kNaN;
    return noise_scale(i) * std::sqrt(rows_[i].sample->covariance_m2(axis, axis)) * kMmPerM;
  }

  static json line(const char* label, const char* kind, const char* colour, json values) {
    return {{"label", label}, {"kind", kind}, {"colour", colour}, {"values", std::move(values)}};
  }

  [[nodiscard]] json path() const {
    json made;
    const char* names[2] = {"observed_x", "observed_y"};
    for (int axis = 0; axis < 2; ++axis)
      made[names[axis]] = column([&](std::size_t i) { return seen(i, axis); });
    if (arc_ == nullptr) return made;
    const char* predicted[2] = {"predicted_x", "predicted_y"};
    for (int axis = 0; axis < 2; ++axis)
      made[predicted[axis]] = column([&](std::size_t i) { return expected(i, axis); });
    return made;
  }

  [[nodiscard]] json position(int axis) const {
    const std::string unit = facts_.metres ? " [mm]" : " [px]";
    json chart{{"label", (axis == 0       ? "x"
                          : facts_.metres ? "y"
                                          : "-y") +
                             unit},
               {"series", json::array()}};
    chart["series"].push_back(
        line("observed", "dots", "observed", column([&](std::size_t i) { return seen(i, axis); })));
    if (arc_ != nullptr)  // over the dots, which would hide it
      chart["series"].push_back(line("predicted", "line", "predicted",
                                     column([&](std::size_t i) { return expected(i, axis); })));
    return chart;
  }

  [[nodiscard]] json position_residual(int axis) const {
    return residual(
        axis == 0 ? "x residual [mm]" : "y residual [mm]", axis == 0 ? "x" : "y",
        [&](std::size_t i) { return seen(i, axis) - expected(i, axis); },
        [&](std::size_t i) { return sigma_mm(i, axis); });
  }

  [[nodiscard]] json spin_residual() const {
    constexpr double kMradPerRad = 1000.0;
    const auto off = [&](std::size_t i) {
      return rows_[i].sample == nullptr
                 ? std::nullopt
                 : spin_residual_rad(*rows_[i].sample, track_.object, facts_.prediction);
    };
    return residual(
        "spin residual [mrad]", "x",
        [&](std::size_t i) { return off(i) ? *off(i) * kMradPerRad : kNaN; },
        [&](std::size_t i) {
          return off(i) ? noise_scale(i) * rows_[i].sample->psi->sigma_rad * kMradPerRad : kNaN;
        });
  }

  template <class Value, class Sigma>
  json residual(const char* label, const char* colour, const Value& value,
                const Sigma& sigma) const {
    json chart{{"label", label}, {"series", json::array()}};
    for (const auto& [factor, shade] : {std::pair(2.0, "band2"), std::pair(1.0, "band")})
      for (const double sign : {1.0, -1.0}) {
        json edge =
            line("band", "band", shade,
                 column([&, factor = factor](std::size_t i) { return sign * factor * sigma(i); }));
        edge["upper"] = sign > 0.0;
        chart["series"].push_back(std::move(edge));
      }
    std::vector<double> sizes;
    for (std::size_t i = 0; i < rows_.size(); ++i)
      for (const double size : {std::abs(value(i)), 2.2 * sigma(i)})
        if (std::isfinite(size)) sizes.push_back(size);
    if (!sizes.empty()) chart["limit"] = number(1.1 * data::quantile(std::move(sizes), 0.995));
    chart["series"].push_back(line("observed − predicted", "dots", colour, column(value)));
    return chart;
  }

  // Tilt, precession, spin: measured where the image told, predicted where the model has them.
  [[nodiscard]] std::vector<json> angles() const {
    struct Angle {
      const char* label;
      std::optional<data::MeasuredAngle> data::TrackSample::*measured;
      double data::Pose<>::*predicted;
      bool modelled;
    };
    const bool tilt = arc_ != nullptr && arc_->has_tilt;
    const Angle list[] = {
        {"tilt θ [deg]", &data::TrackSample::theta, &data::Pose<>::theta_rad, tilt},
        {"precession φ [deg]", &data::TrackSample::phi, &data::Pose<>::phi_rad, tilt},
        {"spin ψ [deg]", &data::TrackSample::psi, &data::Pose<>::psi_rad, arc_ != nullptr}};
    std::vector<json> charts;
    for (const Angle& angle : list) {
      std::vector<double> measured, predicted;
      bool any_seen = false;
      for (std::size_t i = 0; i < rows_.size(); ++i) {
        const auto* sample = rows_[i].sample;
        const bool has = sample != nullptr && (sample->*angle.measured).has_value();
        any_seen = any_seen || has;
        measured.push_back(has ? (sample->*angle.measured)->value_rad : kNaN);
        predicted.push_back(angle.modelled && poses_[i] ? predicted_angle(i, angle.predicted)
                                                        : kNaN);
      }
      const bool is_spin = angle.predicted == &data::Pose<>::psi_rad;
      if (!any_seen && (!angle.modelled || is_spin)) continue;  // an unseen spin has no zero
      if (angle.predicted != &data::Pose<>::theta_rad) align(predicted, measured);
      json chart{{"label", angle.label}, {"series", json::array()}};
      if (any_seen)
        chart["series"].push_back(line("observed", "dots", "observed", column([&](std::size_t i) {
                                         return data::degrees(measured[i]);
                                       })));
      if (angle.modelled)
        chart["series"].push_back(line("predicted", "line", "predicted", column([&](std::size_t i) {
                                         return data::degrees(predicted[i]);
                                       })));
      charts.push_back(std::move(chart));
    }
    return charts;
  }

  // Of the model alone: no camera sees energy or force.
  [[nodiscard]] std::vector<json> dynamics() const {
    std::vector<json> charts;
    if (arc_ == nullptr || !facts_.input.fit) return charts;
    std::vector<double> times_s;
    for (const SampleRow& row : rows_) times_s.push_back(row.t_s);
    for (const DynamicsChart& curve : dynamics_of(facts_.input, track_, times_s)) {
      json chart{{"label", curve.label}, {"series", json::array()}};
      chart["series"].push_back(line("predicted", "line", "predicted",
                                     column([&](std::size_t i) { return curve.values[i]; })));
      charts.push_back(std::move(chart));
    }
    return charts;
  }

  // A track of a body with equal faces reports folded tilts: so is the prediction shown.
  [[nodiscard]] double predicted_angle(std::size_t i, double data::Pose<>::*angle) const {
    const data::Pose<>& pose = *poses_[i];
    const bool turned = facts_.input.tracks.angles_folded && pose.theta_rad > 0.5 * data::kPi;
    if (angle == &data::Pose<>::theta_rad && turned) return data::kPi - pose.theta_rad;
    if (angle == &data::Pose<>::phi_rad && turned) return pose.phi_rad + data::kPi;
    return pose.*angle;
  }

  // Whole turns between two countings of the same angle are a matter of where counting began.
  static void align(std::vector<double>& predicted, const std::vector<double>& measured) {
    std::vector<double> differences;
    for (std::size_t i = 0; i < predicted.size(); ++i)
      if (std::isfinite(measured[i] - predicted[i]))
        differences.push_back(measured[i] - predicted[i]);
    if (differences.empty()) return;
    const double shift =
        data::kTurn * std::round(data::median(std::move(differences)) / data::kTurn);
    for (double& value : predicted) value += shift;
  }

  const ReportFacts& facts_;
  const data::Track& track_;
  std::vector<SampleRow> rows_;
  std::vector<std::optional<data::Pose<>>> poses_;
  const PredictedArc* arc_ = nullptr;
};

}  // namespace

nlohmann::json series_of(const ReportFacts& facts) {
  json made;
  made["objects"] = json::array();
  for (std::size_t i = 0; i < facts.input.tracks.tracks.size(); ++i)
    made["objects"].push_back(ObjectSeries(facts, i).object());
  json times = json::array();
  for (const double t_s : facts.input.video_t_s) times.push_back(std::round(t_s * 1e7) / 1e7);
  made["video"] = {{"rate", facts.input.video_rate_hz}, {"t", std::move(times)}};
  return made;
}

}  // namespace trochoid::tools
