#include "trochoid/data/start_rates.hpp"

namespace trochoid::data {

std::optional<std::pair<const char*, const char*>> rate_named_twice(const StartSettings& start) {
  struct Named {
    const char* name;
    bool given;
  };
  const Named w1{"w1_rad_s", start.w1_rad_s.has_value()};
  const Named w2{"w2_rad_s", start.w2_rad_s.has_value()};
  const Named w3{"w3_rad_s", start.w3_rad_s.has_value()};
  const Named dtheta{"dtheta_rad_s", start.dtheta_rad_s.has_value()};
  const Named dphi{"dphi_rad_s", start.dphi_rad_s.has_value()};
  const Named dpsi{"dpsi_rad_s", start.dpsi_rad_s.has_value()};
  const Named omega_s{"omega_s_rad_s", start.omega_s_rad_s.has_value()};
  for (const auto& [one, other] : {std::pair(w1, dtheta), std::pair(w2, dphi), std::pair(w3, dpsi),
                                   std::pair(omega_s, w3), std::pair(omega_s, dpsi)})
    if (one.given && other.given) return std::pair(one.name, other.name);
  return std::nullopt;
}

}  // namespace trochoid::data
