// The example of docs/library.md: a scene in, a trajectory out.
#include <iostream>

#include "trochoid/data/io.hpp"
#include "trochoid/model/simulate.hpp"

int main() {
  const auto scene = trochoid::data::parse_scene(R"(
    [body]
    kind = "top"
    mass_kg = 0.1
    I_kg_m2 = 1.0
    Is_kg_m2 = 1.5
    l_m = 0.1
    [model]
    name = "top"
    [start]
    theta_rad = 1.0
    omega_s_rad_s = 0.5
    [run]
    until_s = 1.0
  )",
                                                 "consumer");
  const auto run = trochoid::model::simulate(scene);
  std::cout << run.model << ": " << run.values.rows() << " rows to " << run.end_s << " s\n";
  return run.outcome == trochoid::model::Outcome::reached_end ? 0 : 1;
}
