#include "common/comparison_table.hpp"

#include <fmt/format.h>

#include <cmath>

namespace trochoid::tools {
namespace {

std::string held_back_words(double rms_sigma) {
  constexpr double kManyDigits = 1e4;
  if (std::isnan(rms_sigma)) return "-";
  return rms_sigma < kManyDigits ? fmt::format("{:.2f} sigma", rms_sigma)
                                 : fmt::format("{:.2e} sigma", rms_sigma);
}

/// A blank between two columns, however long a number is.
std::string row(const char* star, const std::string& aicc, const std::string& bic,
                const std::string& held_back, const std::string& parameters,
                const std::string& model) {
  return fmt::format("{:<1} {:>10} {:>11} {:>14} {:>11}   {}\n", star, aicc, bic, held_back,
                     parameters, model);
}

}  // namespace

std::string comparison_table(const std::vector<data::ModelScore>& models) {
  if (models.empty()) return {};
  std::string table = row("", "AICc", "BIC", "held back", "parameters", "model");
  for (const data::ModelScore& m : models)
    table += std::isnan(m.bic)
                 ? row("", "-", "-", "-", "-", m.model + ": not fitted: " + m.reason)
                 : row(m.recommended ? "*" : "", fmt::format("{:.2f}", m.aicc),
                       fmt::format("{:.2f}", m.bic), held_back_words(m.held_back_rms_sigma),
                       std::to_string(m.parameters),
                       m.model + (m.reason.empty() ? "" : ": not accepted: " + m.reason));
  return table;
}

}  // namespace trochoid::tools
