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

inline Reference reference(const std::string& name) {
  const std::filesystem::path folder =
      std::filesystem::path(TROCHOID_SOURCE_DIR) / "data" / "reference";
  return {data::read_reference_case(folder / (name + ".json")),
          data::read_table(folder / (name + ".csv"))};
}

}  // namespace trochoid::model
