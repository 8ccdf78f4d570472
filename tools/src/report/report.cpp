#include "report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>

#include "draw/svg.hpp"
#include "report/assets.hpp"
#include "report/parts.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"

namespace trochoid::tools {
namespace {

std::string base64(const std::string& bytes) {
  static const char* const kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    unsigned int group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? kLetters[group >> (18 - 6 * k) & 63u] : '=';
  }
  return text;
}

std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(fmt::format("{}: no such file, or it cannot be read", path.string()));
  return {std::istreambuf_iterator<char>(file), {}};
}

// A "</script" inside embedded data would end the element early.
std::string for_script(std::string text) {
  for (std::size_t at = 0; (at = text.find("</", at)) != std::string::npos; at += 3)
    text.replace(at, 2, "<\\/");
  return text;
}

std::string verdict_section(const Verdict& verdict) {
  std::string html = fmt::format(
      "<section class=\"verdict {}\" id=\"verdict\"><p><strong class=\"word\">{}</strong>{}</p>",
      verdict.grade, escaped(verdict.word), escaped(verdict.sentence));
  if (!verdict.remarks.empty()) {
    html += "<ul>";
    for (const std::string& remark : verdict.remarks)
      html += fmt::format("<li>{}</li>", escaped(remark));
    html += "</ul>";
  }
  return html + "</section>\n";
}

std::string picture_section(const ReportFacts& facts) {
  std::string html = "<section><div class=\"pair\">";
  const bool both = facts.input.fit.has_value();
  if (facts.input.video)
    html += fmt::format(
        "<figure class=\"noprint\"><h2>Recording with {}</h2><video controls loop muted "
        "playsinline preload=\"auto\" src=\"data:video/mp4;base64,{}\"></video>"
        "<figcaption>Click in any plot to see that moment. Blue: observed.{}</figcaption></figure>",
        both ? "both paths" : "its path", base64(bytes_of(*facts.input.video)),
        both ? " Orange: predicted." : "");
  html += fmt::format(
      "<figure><h2>Path of the centre of mass from above</h2>{}</figure></div></section>\n",
      path_figure(facts));
  return html;
}

// "10^-5" as people print it.
std::string with_superscripts(const std::string& text) {
  const std::size_t at = text.find("10^");
  return at == std::string::npos
             ? text
             : text.substr(0, at + 2) + "<sup>" + text.substr(at + 3) + "</sup>";
}

const char* status_words(const data::FitParameter& parameter) {
  if (!parameter.identifiable) return "not seen by the data";
  switch (parameter.status) {
    case data::ParameterStatus::free:
      return "fitted";
    case data::ParameterStatus::fixed:
      return "given";
    case data::ParameterStatus::derived:
      return "derived";
    case data::ParameterStatus::prior:
      return "from the prior";
  }
  return "";
}

std::string parameter_section(const data::Fit& fit) {
  std::string html =
      "<section class=\"long\"><h2>Parameters</h2><div class=\"scroll\"><table "
      "id=\"parameters\"><thead><tr><th>name</th><th class=\"number\">value ± 1 "
      "sigma</th><th>unit</th><th>how</th><th>meaning, remark</th></tr></thead><tbody>";
  // What was learned first, what was put in last.
  for (const bool given : {false, true})
    for (const data::FitParameter& parameter : fit.parameters) {
      if ((parameter.status == data::ParameterStatus::fixed) != given) continue;
      const bool shown = parameter.identifiable || given;
      html += fmt::format(
          "<tr><td><code>{}</code></td><td "
          "class=\"number{}\">{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
          escaped(parameter.name), given || !parameter.identifiable ? "" : " strong",
          shown ? with_superscripts(value_words(parameter.value, parameter.sigma))
                : fmt::format("{} ± ∞", short_number(parameter.value)),
          escaped(unit_words(parameter.unit)), status_words(parameter), escaped(parameter.note));
    }
  html += "</tbody></table></div>";
  html += fmt::format(
      "<p class=\"quiet\">χ² = {:.5g} for {} degrees of freedom; the track's sigmas were scaled by "
      "{:.3g}; whiteness p = {:.2g}; correlation time of the residuals {:.3g} s; "
      "integration error {:.1e} sigma; start: {}. Initial values belong to t = {:.5g} "
      "s{}.</p></section>\n",
      fit.chi2, fit.dof, fit.noise_scale, fit.whiteness_p, fit.correlation_time_s,
      fit.integration_error_sigma, escaped(fit.start_path), fit.time_origin_s,
      fit.arcs.size() > 1 ? "; those of later arcs carry “@” and the arc's number" : "");
  return html;
}

std::string arc_table(const data::Fit& fit) {
  if (fit.arcs.size() < 2) return {};
  std::string html =
      "<h3>Arcs</h3><div class=\"scroll\"><table><thead><tr><th>arc</th><th>object</th><th "
      "class=\"number\">from [s]</th><th class=\"number\">to [s]</th><th "
      "class=\"number\">samples</th></tr></thead><tbody>";
  for (std::size_t i = 0; i < fit.arcs.size(); ++i)
    html += fmt::format(
        "<tr><td>{}</td><td>{}</td><td class=\"number\">{:.4f}</td><td "
        "class=\"number\">{:.4f}</td><td class=\"number\">{}</td></tr>",
        i, fit.arcs[i].object, fit.arcs[i].from_s, fit.arcs[i].to_s, fit.arcs[i].samples);
  return html + "</tbody></table></div>";
}

// A full matrix of forty initial values helps nobody: those that hang together are listed instead.
std::string correlation_table(const data::Fit& fit) {
  constexpr Eigen::Index kWholeMatrix = 12;
  constexpr double kStrong = 0.9;
  const Eigen::Index size = fit.covariance.rows();
  if (size < 2 || size != static_cast<Eigen::Index>(fit.covariance_names.size())) return {};
  // What is not seen has an error bar without end, though the model's curvature gives it one.
  const auto seen = [&](Eigen::Index i) {
    const data::FitParameter* its = fit.find(fit.covariance_names[static_cast<std::size_t>(i)]);
    return its == nullptr || std::isfinite(its->sigma);
  };
  const auto correlation = [&](Eigen::Index i, Eigen::Index k) {
    return seen(i) && seen(k)
               ? fit.covariance(i, k) / std::sqrt(fit.covariance(i, i) * fit.covariance(k, k))
               : std::numeric_limits<double>::quiet_NaN();
  };
  const auto name = [&](Eigen::Index i) {
    return escaped(fit.covariance_names[static_cast<std::size_t>(i)]);
  };
  std::string html = "<h3>Correlations</h3>";
  if (size > kWholeMatrix) {
    std::string list;
    for (Eigen::Index i = 0; i < size; ++i)
      for (Eigen::Index k = 0; k < i; ++k)
        if (std::abs(correlation(i, k)) >= kStrong)
          list += fmt::format("<li><code>{}</code> and <code>{}</code>: {:+.3f}</li>", name(k),
                              name(i), correlation(i, k));
    return html +
           (list.empty()
                ? fmt::format("<p>None of the {} parameters are correlated by more than {}.</p>",
                              size, kStrong)
                : "<ul>" + list + "</ul>");
  }
  html += "<div class=\"scroll\"><table class=\"matrix\"><thead><tr><th></th>";
  for (Eigen::Index i = 0; i < size; ++i)
    html += fmt::format("<th class=\"number\">{}</th>", i + 1);
  html += "</tr></thead><tbody>";
  for (Eigen::Index i = 0; i < size; ++i) {
    html += fmt::format("<tr><th>{} <code>{}</code></th>", i + 1, name(i));
    for (Eigen::Index k = 0; k <= i; ++k) {
      const double value = correlation(i, k);
      html += i == k ? std::string("<td>1</td>")
              : !std::isfinite(value)
                  ? std::string("<td>—</td>")
                  : fmt::format("<td{}>{:+.2f}</td>",
                                std::abs(value) >= kStrong ? " class=\"strong\"" : "", value);
    }
    html += "</tr>";
  }
  return html + "</tbody></table></div>";
}

std::string names_of_unseen(const data::Fit& fit) {
  std::string names;
  for (const data::FitParameter& parameter : fit.parameters)
    if (!parameter.identifiable) names += (names.empty() ? "" : ", ") + parameter.name;
  return names;
}

std::string identifiability_section(const data::Fit& fit) {
  std::string html = "<section class=\"long\"><h2>What the recording can tell</h2>";
  const std::size_t free = fit.covariance_names.size();
  if (!fit.converged)
    html +=
        "<p>This fit does not describe the recording; what follows says what it could tell if it "
        "did.</p>";
  if (fit.null_vectors.empty()) {
    const std::string faint = names_of_unseen(fit);
    html += fmt::format(
        "<p>The data reach all {} free parameters (rank {}, condition number {:.2g} in scaled "
        "units){}.</p>",
        free, fit.rank, fit.condition,
        faint.empty() ? ""
                      : ", but these too faintly for a value: <code>" + escaped(faint) + "</code>");
  } else {
    html += fmt::format("<p>The data determine {} of {} free directions. Not seen:</p><ul>",
                        fit.rank, free);
    for (const data::NullVector& vector : fit.null_vectors) {
      std::string components;
      for (const auto& [name, weight] : vector.components)
        if (std::abs(weight) > 0.05)
          components += fmt::format("{}{:+.2f} {}", components.empty() ? "" : ", ", weight, name);
      html += fmt::format("<li>{} <span class=\"quiet\">({})</span></li>", escaped(vector.words),
                          escaped(components));
    }
    html += "</ul>";
  }
  for (const data::BrokenDegeneracy& broken : fit.broken_degeneracies)
    html += "<p>Degeneracy broken: " + escaped(broken.words) + ".</p>";
  return html + correlation_table(fit) + arc_table(fit) + "</section>\n";
}

std::string comparison_section(const data::Fit& fit) {
  if (fit.comparison.empty()) return {};
  double least = std::numeric_limits<double>::infinity();
  for (const data::ModelScore& score : fit.comparison)
    if (score.aicc < least) least = score.aicc;
  std::string html =
      "<section class=\"long\"><h2>Models compared</h2><p>" + escaped(fit.recommendation) +
      "</p><div class=\"scroll\"><table "
      "id=\"comparison\"><thead><tr><th>model</th><th class=\"number\">parameters</th><th "
      "class=\"number\">ΔAICc</th><th class=\"number\">BIC</th><th class=\"number\">χ²</th><th "
      "class=\"number\">whiteness p</th><th class=\"number\">held-back part "
      "[sigma]</th></tr></thead><tbody>";
  for (const data::ModelScore& score : fit.comparison) {
    if (std::isnan(score.bic)) {
      html += fmt::format("<tr><td>{}</td><td colspan=\"6\">not fitted: {}</td></tr>",
                          escaped(score.model), escaped(score.reason));
      continue;
    }
    html += fmt::format(
        "<tr><td{}>{}{}</td><td class=\"number\">{}</td><td class=\"number\">{:.1f}</td><td "
        "class=\"number\">{:.1f}</td><td class=\"number\">{:.5g}</td><td "
        "class=\"number\">{:.2g}</td><td class=\"number\">{}</td></tr>",
        score.recommended ? " class=\"strong\"" : "", escaped(score.model),
        score.recommended ? " (recommended)" : "", score.parameters, score.aicc - least, score.bic,
        score.chi2, score.whiteness_p,
        std::isnan(score.held_back_rms_sigma) ? "–"
                                              : fmt::format("{:.3g}", score.held_back_rms_sigma));
    if (!score.reason.empty())
      html +=
          fmt::format("<tr class=\"quiet\"><td></td><td colspan=\"6\">not accepted: {}</td></tr>",
                      escaped(score.reason));
  }
  return html +
         "</tbody></table></div><p class=\"quiet\">Lower ΔAICc and BIC are better; “held-back "
         "part” is the rms error of predicting the last part of the track from the rest. The "
         "simplest model that suffices is recommended.</p></section>\n";
}

std::string quality_section(const ReportFacts& facts) {
  const data::TrackFile& file = facts.input.tracks;
  std::string html = "<section><h2>Tracking</h2><dl>";
  const auto entry = [&](const std::string& term, const std::string& text) {
    html += fmt::format("<dt>{}</dt><dd>{}</dd>", escaped(term), escaped(text));
  };
  entry("samples",
        fmt::format("{}{} over {:.4g} s", facts.samples,
                    facts.input.frames > 0 ? fmt::format(" in {} frames", facts.input.frames) : "",
                    facts.last_s - facts.first_s));
  entry("gaps", facts.missing > 0 ? fmt::format("{} frames in {} gaps", facts.missing, facts.gaps)
                                  : "none");
  entry("doubtful", facts.doubtful > 0
                        ? fmt::format("{} samples (quality below 0.5)", facts.doubtful)
                        : "none");
  entry("metres", file.camera.empty()
                      ? (facts.metres ? "as given in the file" : "unknown: pixels only")
                      : file.camera);
  if (std::isfinite(facts.median_sigma_m))
    entry("error of a position", fmt::format("{:.3g} mm per axis (median, as the tracker states)",
                                             facts.median_sigma_m * 1000.0));
  if (facts.input.fit && std::isfinite(facts.rms_axis_sigma))
    entry("normalised error",
          fmt::format("{:.3f} (residual rms over stated sigma; 1 when both are right)",
                      facts.rms_axis_sigma));
  if (file.angles_folded) entry("tilt", "folded to 0..90 degrees: the faces look alike");
  return html + "</dl></section>\n";
}

std::string residual_section(const ReportFacts& facts) {
  std::string figures;
  const auto add = [&](const std::string& svg, const char* words) {
    if (!svg.empty())
      figures += fmt::format("<figure>{}<figcaption>{}</figcaption></figure>", svg, words);
  };
  if (!facts.prediction.arcs.empty()) {
    add(histogram_figure(facts),
        "Residuals in units of their sigma, and the normal distribution they should follow.");
    add(correlation_figure(facts),
        "Autocorrelation of the residuals; outside the band they hang together.");
    add(cost_figure(facts),
        "Error of the integration against its run time on this machine: below the dashed line it "
        "is smaller than the tracker's error.");
  }
  return figures.empty() ? ""
                         : fmt::format(
                               "<section><h2>Residuals and cost</h2><div "
                               "class=\"figures\">{}</div></section>\n",
                               figures);
}

std::string series_section(const nlohmann::json& series) {
  std::string html =
      "<section class=\"long\"><h2>In time</h2><p class=\"quiet noprint\">Click: show that moment "
      "in the video. Drag: zoom. Double click: all.</p>";
  for (std::size_t i = 0; i < series["objects"].size(); ++i) {
    const auto& object = series["objects"][i];
    if (!object["name"].get<std::string>().empty())
      html += fmt::format("<h3>{}</h3>", escaped(object["name"]));
    html += "<div class=\"charts\">";
    for (std::size_t k = 0; k < object["charts"].size(); ++k)
      html += fmt::format("<div class=\"chart\" data-object=\"{}\" data-chart=\"{}\"></div>", i, k);
    html += "</div>";
  }
  return html + "</section>\n";
}

std::string origin_section(const ReportInput& input) {
  std::string html = "<section class=\"long\"><h2>To reproduce and cite</h2>";
  if (!input.command.empty())
    html += fmt::format("<pre class=\"code\">{}</pre>", escaped(input.command));
  html += "<div class=\"scroll\"><table><tbody>";
  const auto row = [&](const std::string& name, const std::string& value) {
    html +=
        fmt::format("<tr><td>{}</td><td><code>{}</code></td></tr>", escaped(name), escaped(value));
  };
  std::map<std::string, std::string> checksums = input.checksums;
  std::map<std::string, std::string> versions{{"trochoid", TROCHOID_VERSION}};
  if (input.fit) {
    checksums.insert(input.fit->inputs.begin(), input.fit->inputs.end());
    versions.insert(input.fit->versions.begin(), input.fit->versions.end());
    row("random seed", std::to_string(input.fit->seed));
  }
  if (!input.tracks.source_sha256.empty())
    checksums.emplace(input.tracks.source, input.tracks.source_sha256);
  for (const auto& [name, version] : versions) row(name, version);
  for (const auto& [name, digest] : checksums)
    row(name, digest.empty() ? "no checksum" : "sha256 " + digest);
  for (const auto& [stage, seconds] : input.times_s) {
    std::string words = "time to " + stage;
    std::replace(words.begin(), words.end(), '_', ' ');
    if (stage != "fit" || input.fit) row(words, fmt::format("{:.2f} s", seconds));
  }
  html += "</tbody></table></div>";
  if (input.scene)
    html += fmt::format(
        "<details><summary>Scene as used</summary><pre class=\"code\">{}</pre></details>",
        escaped(data::to_toml(*input.scene)));
  return html + fmt::format(
                    "<p>Cite as: trochoid {}, tracking and model fitting of spinning and rolling "
                    "discs in video, with the recording's checksum.</p></section>\n",
                    TROCHOID_VERSION);
}

}  // namespace

std::string make_report(const ReportInput& input) {
  const ReportFacts facts = gather(input);
  const nlohmann::json series = series_of(facts);
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\">"
      "<link rel=\"icon\" href=\"data:,\"><title>{0}: trochoid "
      "report</title>\n<style>{1}</style>\n<style>{2}</style></head><body><main><h1>{0}</h1>\n",
      escaped(input.title), assets::plot_library_css, assets::report_css);
  html += verdict_section(judge(facts)) + picture_section(facts);
  if (input.fit && !input.fit->parameters.empty())
    html += parameter_section(*input.fit) + identifiability_section(*input.fit);
  html += series_section(series) + residual_section(facts);
  if (input.fit) html += comparison_section(*input.fit);
  html += quality_section(facts) + origin_section(input);
  html += fmt::format(
      "</main>\n<script type=\"application/json\" "
      "id=\"data\">{}</script>\n<script>{}</script>\n<script>{}</script>\n<!-- uPlot: {} "
      "-->\n</body></html>\n",
      for_script(series.dump()), assets::plot_library_js, assets::report_js,
      assets::plot_library_licence);
  return html;
}

std::string make_path_svg(const ReportInput& input) {
  return standalone(path_figure(gather(input)));
}

}  // namespace trochoid::tools
