#pragma once

/// Scripts and style sheets of the report, embedded at build time from tools/report.
namespace trochoid::tools::assets {
extern const char* const plot_library_js;  ///< uPlot
extern const char* const plot_library_css;
extern const char* const plot_library_licence;
extern const char* const report_js;
extern const char* const report_css;
}  // namespace trochoid::tools::assets
