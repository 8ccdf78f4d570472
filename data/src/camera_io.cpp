#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>

#include "json_read.hpp"
#include "trochoid/data/io.hpp"

// camera.json: docs/formats.md.
namespace trochoid::data {
namespace {

// In the order of Camera::Deviation.
constexpr std::array<const char*, Camera::kNumbers> kNumberNames{
    "fx", "fy",         "cx",         "cy",         "k1",        "k2",        "p1",       "p2",
    "k3", "turn_x_rad", "turn_y_rad", "turn_z_rad", "shift_x_m", "shift_y_m", "shift_z_m"};

int image_size(const JsonReader& json, const char* key) {
  constexpr double kLargest_px = 65536.0;
  const double value = json.number(key);
  if (!(value >= 1.0 && value <= kLargest_px && value == std::floor(value)))
    json.fail(fmt::format("\"{}\" = {} must be a whole number of pixels in 1..{}", key, value,
                          kLargest_px));
  return static_cast<int>(value);
}

double positive(const JsonReader& json, const char* key) {
  const double value = json.number(key);
  if (!(value > 0.0)) json.fail(fmt::format("\"{}\" = {} must be greater than 0", key, value));
  return value;
}

Eigen::Matrix3d rotation(const JsonReader& json, const char* key) {
  const nlohmann::json& rows = json.at(key);
  if (!rows.is_array() || rows.size() != 3)
    json.fail(fmt::format("\"{}\" must be a list of three rows", key));
  Eigen::Matrix3d R;
  for (int row = 0; row < 3; ++row) {
    const nlohmann::json wrapped{{key, rows[row]}};
    const auto values = JsonReader(wrapped, json.where()).numbers(key, 3);
    for (int column = 0; column < 3; ++column) R(row, column) = values[column];
  }
  constexpr double kRoundedByHand = 1e-3;  // three printed digits still make a usable rotation
  const double error = (R * R.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(error < kRoundedByHand) || R.determinant() < 0.0)
    json.fail(
        fmt::format("\"{}\" is no rotation (its rows must be orthonormal, right-handed)", key));
  // Its transpose is taken for its inverse: of three digits that would be off by a tenth of a
  // pixel.
  constexpr double kExact = 1e-12;
  if (error < kExact) return R;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();  // the nearest rotation
}

Camera::Projection projection_of(const JsonReader& json) {
  const std::string name = json.text_or("projection", "perspective");
  if (name == "perspective") return Camera::Projection::perspective;
  if (name == "orthographic") return Camera::Projection::orthographic;
  json.fail("\"projection\" must be perspective or orthographic");
}

Transfer transfer_of(const JsonReader& json) {
  const std::string name = json.text_or("transfer", "sRGB");
  if (name == "sRGB") return Transfer::srgb;
  if (name == "linear") return Transfer::linear;
  json.fail("\"transfer\" must be sRGB or linear");
}

bool metres_by_radius(const JsonReader& json) {
  const std::string by = json.text_or("metres_by", "calibration");
  if (by != "calibration" && by != "body_radius")
    json.fail("\"metres_by\" must be calibration or body_radius");
  return by == "body_radius";
}

std::vector<Eigen::Index> numbers_named(const JsonReader& json, const char* key) {
  const nlohmann::json& names = json.at(key);
  if (!names.is_array() || names.empty())
    json.fail(fmt::format("\"covariance\": \"{}\" must be a list of the numbers meant", key));
  std::vector<Eigen::Index> out;
  for (const nlohmann::json& name : names) {
    const auto at = std::find_if(kNumberNames.begin(), kNumberNames.end(),
                                 [&](const char* known) { return name == known; });
    const Eigen::Index index = at - kNumberNames.begin();
    if (at == kNumberNames.end())
      json.fail(fmt::format("\"covariance\": {} is none of {}", name.dump(),
                            fmt::join(kNumberNames, ", ")));
    if (std::find(out.begin(), out.end(), index) != out.end())
      json.fail(fmt::format("\"covariance\": {} is named twice", name.dump()));
    out.push_back(index);
  }
  return out;
}

// "covariance": {"of": the numbers that are uncertain, "matrix": as many rows of as many}.
Eigen::MatrixXd covariance_of(const JsonReader& json, const char* key) {
  const nlohmann::json& object = json.at(key);
  if (!object.is_object()) json.fail(fmt::format("\"{}\" must be an object", key));
  const JsonReader inner(object, json.where());
  const std::vector<Eigen::Index> of = numbers_named(inner, "of");
  const nlohmann::json& rows = inner.at("matrix");
  const auto n = static_cast<Eigen::Index>(of.size());
  if (!rows.is_array() || rows.size() != of.size())
    json.fail(fmt::format("\"{}\": \"matrix\" must have {} rows", key, n));
  Eigen::MatrixXd given(n, n);
  for (Eigen::Index row = 0; row < n; ++row) {
    const nlohmann::json wrapped{{"matrix", rows[static_cast<std::size_t>(row)]}};
    const auto values = JsonReader(wrapped, json.where()).numbers("matrix", of.size());
    given.row(row) = Eigen::Map<const Eigen::RowVectorXd>(values.data(), n);
  }
  constexpr double kRounded = 1e-6;  // of what the variances allow
  const Eigen::VectorXd sd = given.diagonal().cwiseMax(0.0).cwiseSqrt();
  const bool symmetric =
      ((given - given.transpose()).array().abs() <= kRounded * (sd * sd.transpose()).array()).all();
  const Eigen::VectorXd inverse = (sd.array() > 0.0).select(sd.cwiseInverse(), 1.0);
  if (!symmetric || (given.diagonal().array() < 0.0).any() ||
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(
          inverse.asDiagonal() * given * inverse.asDiagonal(), Eigen::EigenvaluesOnly)
              .eigenvalues()
              .minCoeff() < -kRounded)
    json.fail(
        fmt::format("\"{}\" is no covariance: its matrix must be symmetric, and no "
                    "combination of what it is of may have a variance below 0",
                    key));
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(Camera::kNumbers, Camera::kNumbers);
  out(of, of) = given;
  return out;
}

nlohmann::ordered_json json_of(const Eigen::MatrixXd& covariance) {
  nlohmann::ordered_json out;
  std::vector<Eigen::Index> of;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i)
    if (covariance(i, i) > 0.0) of.push_back(i);
  for (const Eigen::Index i : of) out["of"].push_back(kNumberNames[static_cast<std::size_t>(i)]);
  for (const Eigen::Index i : of) {
    nlohmann::ordered_json row;
    for (const Eigen::Index k : of) row.push_back(covariance(i, k));
    out["matrix"].push_back(std::move(row));
  }
  return out;
}

// No lens looks farther to the side than 89 degrees.
void check_angle(const JsonReader& json, const char* centre_key, double centre_px, int size_px,
                 const char* focal_key, double focal_px) {
  constexpr double kWidest = 57.0;  // tangent
  if (std::max(std::abs(centre_px), std::abs(size_px - centre_px)) <= kWidest * focal_px) return;
  if (centre_px >= 0.0 && centre_px <= size_px)
    json.fail(fmt::format(
        "\"{}\" = {} must be the focal length in pixels: at this one, {} of them see all there is",
        focal_key, focal_px, size_px));
  json.fail(
      fmt::format("\"{}\" = {} lies so far outside a picture of {} px that nothing is seen there",
                  centre_key, centre_px, size_px));
}

bool shows_floor(const Camera& camera) {
  constexpr std::array kShares{0.0, 0.25, 0.5, 0.75, 1.0};
  for (const double across : kShares)
    for (const double down : kShares) {
      try {
        static_cast<void>(
            camera.table_from_image({across * camera.width_px, down * camera.height_px}, 0.0));
        return true;
      } catch (const NumericalError&) {  // above the horizon, or where the distortion does not hold
      }
    }
  return false;
}

// That some of the picture shows the floor, from above.
void check_view(const JsonReader& json, const Camera& camera) {
  if (camera.projection == Camera::Projection::orthographic) {
    if (!(camera.camera_from_table(2, 2) < 0.0))
      json.fail("the camera of \"R_world_to_cam\" looks up: its third row must point down");
    return;
  }
  check_angle(json, "cx", camera.cx, camera.width_px, "fx", camera.fx);
  check_angle(json, "cy", camera.cy, camera.height_px, "fy", camera.fy);
  const double height_m = -(camera.camera_from_table.transpose() * camera.camera_from_table_m).z();
  if (!(height_m > 0.0))
    json.fail(fmt::format(
        "by \"R_world_to_cam\" and \"t_world_to_cam_m\" the camera is at z = {:.4g} m; it must be "
        "above the floor, z = 0",
        height_m));
  if (!shows_floor(camera))
    json.fail("the camera of \"R_world_to_cam\" looks up: no part of its picture shows the floor");
}

}  // namespace

Camera read_camera(const std::filesystem::path& path) {
  const nlohmann::json object = read_json_object(path);
  const JsonReader json(object, path.string());
  Camera camera;
  camera.file = path.string();
  camera.projection = projection_of(json);
  camera.width_px = image_size(json, "width");
  camera.height_px = image_size(json, "height");
  camera.fx = positive(json, "fx");
  camera.fy = positive(json, "fy");
  camera.cx = json.number("cx");
  camera.cy = json.number("cy");
  if (json.has("dist_k1_k2_p1_p2_k3")) {
    const auto values = json.numbers("dist_k1_k2_p1_p2_k3", 5);
    std::copy(values.begin(), values.end(), camera.distortion.begin());
  }
  camera.camera_from_table = rotation(json, "R_world_to_cam");
  const auto t = json.numbers("t_world_to_cam_m", 3);
  camera.camera_from_table_m = {t[0], t[1], t[2]};
  if (json.has("fps")) camera.frame_rate_hz = positive(json, "fps");
  if (json.has("shutter_fraction_of_frame")) {
    camera.exposure_fraction = json.number("shutter_fraction_of_frame");
    if (!(*camera.exposure_fraction >= 0.0 && *camera.exposure_fraction <= 1.0))
      json.fail(fmt::format("\"shutter_fraction_of_frame\" = {} must lie in 0..1",
                            *camera.exposure_fraction));
  }
  if (json.has("readout_s")) {
    const double readout_s = json.number("readout_s");
    if (!(readout_s >= 0.0))
      json.fail(fmt::format("\"readout_s\" = {} must be 0 or greater", readout_s));
    if (readout_s > 0.0) camera.readout_s = readout_s;
  }
  camera.transfer = transfer_of(json);
  camera.metres_by_radius = metres_by_radius(json);
  if (json.has("covariance")) camera.covariance = covariance_of(json, "covariance");
  check_view(json, camera);
  return camera;
}

std::optional<Camera> camera_of(const Scene& scene, int width_px, int height_px) {
  const CameraSettings& given = scene.camera;
  if (!given.file.empty()) return read_camera(given.file);
  if (!given.scale_px_per_m) return std::nullopt;
  if (given.height_m)
    return Camera::overhead(width_px, height_px, *given.scale_px_per_m, *given.height_m);
  return Camera::from_scale(width_px, height_px, *given.scale_px_per_m);
}

void write_camera(const Camera& camera, const std::filesystem::path& path) {
  nlohmann::ordered_json json;
  json["width"] = camera.width_px;
  json["height"] = camera.height_px;
  if (camera.frame_rate_hz) json["fps"] = *camera.frame_rate_hz;
  if (camera.exposure_fraction) json["shutter_fraction_of_frame"] = *camera.exposure_fraction;
  if (camera.readout_s) json["readout_s"] = *camera.readout_s;
  if (camera.transfer == Transfer::linear) json["transfer"] = "linear";
  if (camera.metres_by_radius) json["metres_by"] = "body_radius";
  json["pixel_convention"] = "centre of the top-left pixel is (0,0); x right, y down";
  if (camera.projection == Camera::Projection::orthographic) json["projection"] = "orthographic";
  json["fx"] = camera.fx;
  json["fy"] = camera.fy;
  json["cx"] = camera.cx;
  json["cy"] = camera.cy;
  json["dist_k1_k2_p1_p2_k3"] = camera.distortion;
  for (int row = 0; row < 3; ++row)
    json["R_world_to_cam"].push_back({camera.camera_from_table(row, 0),
                                      camera.camera_from_table(row, 1),
                                      camera.camera_from_table(row, 2)});
  const Eigen::Vector3d& t = camera.camera_from_table_m;
  json["t_world_to_cam_m"] = {t.x(), t.y(), t.z()};
  const Eigen::Vector3d at = camera.position_m();
  json["camera_position_m"] = {at.x(), at.y(), at.z()};
  if ((camera.covariance.diagonal().array() > 0.0).any())
    json["covariance"] = json_of(camera.covariance);
  write_text(json.dump(1) + "\n", path);
}

}  // namespace trochoid::data
