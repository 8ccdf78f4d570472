#pragma once
#include <Eigen/Core>
#include <fstream>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "trochoid/data/reference_case.hpp"
#include "trochoid/data/scene.hpp"
#include "trochoid/data/track.hpp"

// Reference trajectories of an independent integrator with noise added.
namespace trochoid::fitting {

// An independent integrator's motion: the first seconds at the full rate.
inline std::string motion_file(const std::string& name) {
  return std::string(TROCHOID_SOURCE_DIR) + "/tests/fitting/motions/" + name + ".csv";
}

struct NoisyMotion {
  data::Scene scene;
  data::Track track;
};

// Columns by name of a reference CSV.
inline std::map<std::string, std::vector<double>> columns_of(const std::string& path) {
  std::ifstream file(path);
  std::string line, cell;
  std::getline(file, line);
  std::vector<std::string> names;
  for (std::istringstream header(line); std::getline(header, cell, ',');) names.push_back(cell);
  std::map<std::string, std::vector<double>> columns;
  while (std::getline(file, line)) {
    std::istringstream row(line);
    for (const std::string& name : names) {
      std::getline(row, cell, ',');
      columns[name].push_back(std::stod(cell));
    }
  }
  return columns;
}

// `until_s` keeps the test short; the start and the losses the scene knows are not the truth.
inline NoisyMotion noisy(const std::string& name, double until_s, double sigma_m,
                         std::size_t step = 1, unsigned seed = 7) {
  const std::string given = std::string(TROCHOID_SOURCE_DIR) + "/data/reference/" + name + ".json";
  NoisyMotion made{data::read_reference_case(given).scene, {}};
  made.scene.start = {};
  const auto columns = columns_of(motion_file(name));
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, sigma_m);
  for (std::size_t i = 0; i < columns.at("t").size() && columns.at("t")[i] <= until_s; i += step) {
    data::TrackSample sample;
    sample.t_s = columns.at("t")[i];
    sample.centre_m = {columns.at("x")[i] + normal(generator),
                       columns.at("y")[i] + normal(generator)};
    sample.covariance_m2 = Eigen::Matrix2d::Identity() * sigma_m * sigma_m;
    made.track.samples.push_back(sample);
  }
  return made;
}

}  // namespace trochoid::fitting
