#pragma once
#include <filesystem>
#include <string>

#include "trochoid/data/io.hpp"
#include "trochoid/data/reference_case.hpp"

namespace trochoid::model {

/// A reference trajectory with the scene that poses it.
struct Reference {
  data::ReferenceCase posed;
  data::Table table;
  [[nodiscard]] Eigen::VectorXd column(const char* name) const { return table.column(name); }
};

inline std::filesystem::path reference_path(const std::string& name, const char* ending) {
  return std::filesystem::path(TROCHOID_SOURCE_DIR) / "data" / "reference" / (name + ending);
}

inline data::Scene reference_scene(const std::string& name) {
  return data::read_reference_case(reference_path(name, ".json")).scene;
}

inline Reference reference(const std::string& name) {
  return {data::read_reference_case(reference_path(name, ".json")),
          data::read_table(reference_path(name, ".csv"))};
}

}  // namespace trochoid::model
