#include <fmt/core.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>

#include "arrays.hpp"
#include "common/fit_job.hpp"
#include "common/fitted_scene.hpp"
#include "common/outputs.hpp"
#include "common/prediction.hpp"
#include "common/progress.hpp"
#include "common/provenance.hpp"
#include "common/scene_library.hpp"
#include "common/trajectory_table.hpp"
#include "common/value_words.hpp"
#include "interruptible.hpp"
#include "trochoid/data/error.hpp"
#include "trochoid/data/io.hpp"
#include "trochoid/data/scene_error.hpp"
#include "trochoid/model/simulate.hpp"
#ifdef TROCHOID_HAS_TRACKING
#include "common/track_options.hpp"
#include "draw/encoded_file.hpp"
#include "draw/overlay.hpp"
#include "report/run_folder.hpp"
#include "trochoid/tracking/smooth.hpp"
#include "trochoid/tracking/tracker.hpp"
#endif

// The compiled half of the Python package: values cross here, as dicts of arrays; signatures,
// documentation and types are trochoid/__init__.py. Each function calls what the subcommand of its
// name calls.
namespace trochoid::python {
namespace py = pybind11;
namespace fs = std::filesystem;
namespace {

struct SceneValue {
  data::Scene scene;
};

/// What was set from Python passes the same checks as a scene file. @throws InputError without the
/// line: nobody has seen the text in which it would be counted.
data::Scene checked(const data::Scene& scene) {
  try {
    return data::parse_scene(data::to_toml(scene), "scene");
  } catch (const data::SceneError& error) {
    throw InputError("scene: " + error.words());
  }
}

/// A scene from tables whose text Python has written: `tables` names the one each line belongs to,
/// and errors name it in place of the line.
SceneValue scene_of_tables(const std::string& toml, const std::vector<std::string>& tables) {
  try {
    return {data::parse_scene(toml, "scene")};
  } catch (const data::SceneError& error) {
    if (error.line() < 1 || error.line() > tables.size()) throw;
    throw InputError("scene['" + tables[error.line() - 1] + "']: " + error.words());
  }
}

/// A word about samples that were no measurement; empty if all were.
std::string left_out_words(const py::list& given, const std::vector<data::Track>& tracks) {
  std::size_t samples = 0, kept = 0;
  for (const py::handle track : given) samples += py::len(track["t_s"]);
  for (const data::Track& track : tracks) kept += track.samples.size();
  if (samples == kept) return {};
  return fmt::format("{} of {} samples give no position and are left out: gaps", samples - kept,
                     samples);
}

data::Fit fit(const py::list& tracks, const SceneValue& scene, bool compare,
              const py::dict& options, const tools::Checksums& inputs) {
  const std::vector<data::Track> values = tracks_of(tracks);
  fitting::FitOptions how;
  how.model = options["model"].cast<std::string>();
  how.from = options["from"].cast<std::string>();
  how.to = options["to"].cast<std::string>();
  how.free_pivot = options["free_pivot"].cast<bool>();
  how.profile = options["profile"].cast<bool>();
  how.bootstrap = options["bootstrap"].cast<int>();
  how.threads = options["threads"].cast<int>();
  how.seed = options["seed"].cast<std::uint64_t>();
  how.start = options["start"].cast<std::map<std::string, double>>();
  data::Fit result;
  run_interruptibly([&](const Interrupt& interrupt) {
    how.log = [&](const std::string&) { interrupt.check(); };
    how.progress = [&](const std::string&) { interrupt.check(); };
    result = tools::fit_job(values, scene.scene, how, compare);
  });
  result.inputs = inputs;
  if (std::string words = left_out_words(tracks, values); !words.empty())
    result.warnings.push_back(std::move(words));
  return result;
}

py::dict dict_of_run(const model::Trajectory& run) {
  py::dict dict;
  dict["model"] = run.model;
  dict["integrator"] = run.integrator;
  dict["integrator_reason"] = run.integrator_reason;
  dict["columns"] = run.columns;
  dict["values"] = array_of(run.values);
  py::list events;
  for (const model::Event& event : run.events) events.append(py::make_tuple(event.t_s, event.name));
  dict["events"] = events;
  dict["outcome"] = std::string(model::name(run.outcome));
  dict["sentence"] = std::string(model::sentence(run.outcome));
  dict["end_s"] = run.end_s;
  dict["error_estimate_m"] = run.error_estimate_m;
  dict["error_estimate_rad"] = run.error_estimate_rad;
  dict["steps"] = run.statistics.steps;
  dict["evaluations"] = run.statistics.evaluations;
  return dict;
}

py::dict simulate(const SceneValue& scene, const fs::path& output) {
  model::Trajectory run;
  run_interruptibly([&](const Interrupt&) {
    run = model::simulate(scene.scene);
    if (!output.empty()) data::write_table(tools::trajectory_table(run), output);
  });
  return dict_of_run(run);
}

/// The fitted model's path over each arc of the tracks.
py::list predict(const data::Fit& fit, const py::dict& file, std::optional<int> fit_track) {
  const data::TrackFile tracks = file_of(file);
  tools::PredictedPath path;
  run_interruptibly([&](const Interrupt&) {
    path = tools::replay(fit, tracks, tools::place_in_fit(fit, "fit", tracks, fit_track));
  });
  py::list arcs;
  for (const tools::PredictedArc& arc : path.arcs) {
    Eigen::MatrixXd centre_m(arc.pose.size(), 3), angles_rad(arc.pose.size(), 3);
    for (Eigen::Index i = 0; i < centre_m.rows(); ++i) {
      const data::Pose<>& pose = arc.pose[static_cast<std::size_t>(i)];
      constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
      centre_m.row(i) = pose.centre_m;
      angles_rad.row(i) << (arc.has_tilt ? pose.theta_rad : kNone),
          (arc.has_tilt ? pose.phi_rad : kNone), pose.psi_rad;
    }
    py::dict dict;
    dict["object"] = arc.object;
    dict["t_s"] = array_of(arc.t_s);
    dict["centre_m"] = array_of(centre_m);
    dict["angles_rad"] = array_of(angles_rad);
    dict["ended"] = arc.ended;
    arcs.append(dict);
  }
  return arcs;
}

#ifdef TROCHOID_HAS_TRACKING
py::tuple track(const fs::path& video, const SceneValue& scene,
                const std::optional<fs::path>& camera_file, const py::dict& options) {
  tools::TrackChoices choices;
  choices.objects = options["objects"].cast<std::optional<int>>();
  choices.rate_hz = options["rate_hz"].cast<std::optional<double>>();
  if (const auto at = options["at_px"].cast<std::optional<std::pair<double, double>>>())
    choices.at_px = Eigen::Vector2d(at->first, at->second);
  choices.from = options["from"].cast<std::string>();
  choices.to = options["to"].cast<std::string>();
  choices.effort = tools::effort_named(options["effort"].cast<std::string>());
  const data::Scene with = checked(tools::chosen_scene(scene.scene, choices));
  std::optional<data::Camera> camera;
  if (camera_file) camera = data::read_camera(*camera_file);
  tracking::TrackOptions how = tools::track_options(with, choices);
  how.edges = !options["edges"].is_none();
  tracking::TrackResult result;
  run_interruptibly([&](const Interrupt& interrupt) {
    how.checkpoint = [&] { interrupt.check(); };
    result = tracking::track_video(video, with, camera, how);
  });
  result.file.made_by = "trochoid " TROCHOID_VERSION;
  if (result.edges) data::write_table(*result.edges, options["edges"].cast<fs::path>());
  const tracking::TrackSummary& s = result.summary;
  py::dict summary;
  if (!options["smooth"].is_none()) {
    const auto target = options["smooth"].cast<fs::path>();
    tracking::SmoothTrack smoothed;
    run_interruptibly([&](const Interrupt&) {
      smoothed = tracking::smooth_track(result.file);
      data::write_table(smoothed.table, target);
    });
    summary["interpolated"] = smoothed.interpolated;
    summary["left_out"] = smoothed.left_out;
  }
  summary["frames"] = s.frames;
  summary["found"] = s.found;
  summary["lost"] = s.lost;
  summary["doubtful"] = s.doubtful;
  summary["damaged"] = s.damaged;
  summary["metres"] = text_of(s.camera_words);
  return py::make_tuple(dict_of(result.file), summary);
}

py::dict overlay(const fs::path& video, const py::dict& file, const data::Fit* fit,
                 const SceneValue* scene, const std::optional<fs::path>& camera_file,
                 const py::dict& options) {
  const auto output = options["output"].cast<fs::path>(), still = options["still"].cast<fs::path>();
  if (!still.empty()) tools::check_picture_name(still);
  if (!output.empty()) tools::check_overlay_name(output);
  tools::OverlayInput input;
  input.video = video;
  input.tracks = file_of(file);
  const auto fit_file = options["fit_file"].cast<fs::path>();  // where they are files, not values
  if (fit != nullptr) input.fit = *fit;
  if (scene != nullptr)
    input.scene = scene->scene;
  else if (fit != nullptr)
    input.scene = tools::scene_with_camera(*fit, fit_file.empty() ? fs::path("fit") : fit_file);
  if (camera_file) input.camera = data::read_camera(*camera_file);
  if (fit != nullptr)
    input.fit_track =
        tools::place_in_fit(*fit, fit_file.empty() ? "fit" : fit_file.string(), input.tracks,
                            options["fit_track"].cast<std::optional<int>>());
  const auto track_file = options["track_file"].cast<fs::path>();
  tools::check_recording(input, track_file.empty() ? "track" : track_file.string());
  tools::OverlayOptions how{.from = options["from"].cast<std::string>(),
                            .to = options["to"].cast<std::string>(),
                            .slow = options["slow"].cast<double>(),
                            .between_pictures = {}};
  tools::OverlayFrames frames;
  run_interruptibly([&](const Interrupt& interrupt) {
    how.between_pictures = [&] { interrupt.check(); };
    if (!still.empty()) tools::write_still(input, how, still);
    if (!output.empty()) frames = tools::write_overlay(input, how, output);
  });
  py::dict dict;
  dict["frame_rate_hz"] = frames.frame_rate_hz;
  dict["slowed"] = frames.slowed;
  dict["frame"] =
      py::array_t<std::int64_t>(static_cast<py::ssize_t>(frames.frame.size()), frames.frame.data());
  dict["t_s"] = array_of(frames.t_s);
  return dict;
}
#endif

void add_fit_parts(py::module_& module) {
  using data::BrokenDegeneracy, data::FitParameter, data::FitArc, data::ModelScore,
      data::NullVector;
  py::class_<FitParameter>(module, "Parameter", "One parameter of a fit.")
      .def_readonly("name", &FitParameter::name)
      .def_readonly("value", &FitParameter::value)
      .def_readonly("sigma", &FitParameter::sigma, "Standard deviation; 0 if fixed, inf if unseen.")
      .def_readonly("unit", &FitParameter::unit)
      .def_readonly("identifiable", &FitParameter::identifiable)
      .def_readonly("note", &FitParameter::note)
      .def_property_readonly(
          "status", [](const FitParameter& p) { return name(p.status); },
          "free, fixed, derived or prior")
      .def("__repr__", [](const FitParameter& p) {
        const std::string unit = tools::unit_words(p.unit);
        return py::str("{} = {:.8g} ± {:.2g}{}{}")
            .format(p.name, p.value, p.sigma, unit.empty() ? "" : " ", unit);
      });
  py::class_<FitArc>(module, "Arc", "A stretch of a track that was fitted as one motion.")
      .def_readonly("track", &FitArc::track)
      .def_readonly("object", &FitArc::object)
      .def_readonly("from_s", &FitArc::from_s)
      .def_readonly("to_s", &FitArc::to_s)
      .def_readonly("samples", &FitArc::samples)
      .def_readonly("noise_scale", &FitArc::noise_scale);
  py::class_<ModelScore>(module, "ModelScore", "A model that was tried.")
      .def_readonly("model", &ModelScore::model)
      .def_readonly("chi2", &ModelScore::chi2)
      .def_readonly("aicc", &ModelScore::aicc)
      .def_readonly("bic", &ModelScore::bic)
      .def_readonly("whiteness_p", &ModelScore::whiteness_p)
      .def_readonly("held_back_rms_sigma", &ModelScore::held_back_rms_sigma)
      .def_readonly("parameters", &ModelScore::parameters)
      .def_readonly("recommended", &ModelScore::recommended)
      .def_readonly("reason", &ModelScore::reason);
  py::class_<NullVector>(module, "NullVector",
                         "A direction of parameter space the data do not see.")
      .def_readonly("components", &NullVector::components, "Weight by parameter name, unit length.")
      .def_readonly("words", &NullVector::words);
  py::class_<BrokenDegeneracy>(module, "BrokenDegeneracy",
                               "What only some of the angles seen in the recording tell.")
      .def_readonly("readings", &BrokenDegeneracy::readings, "tilt, precession, spin or angles.")
      .def_readonly("parameters", &BrokenDegeneracy::parameters, "Names.")
      .def_readonly("words", &BrokenDegeneracy::words);
}

void add_error_bars(py::module_& module) {
  using data::Bootstrap, data::BootstrapSpread, data::Profile;
  py::class_<Profile>(module, "Profile", "How well the fit holds at fixed values of a parameter.")
      .def_readonly("parameter", &Profile::parameter)
      .def_property_readonly(
          "verdict", [](const Profile& p) { return name(p.verdict); }, "bounded, one-sided or flat")
      .def_readonly("lower_95", &Profile::lower_95)
      .def_readonly("upper_95", &Profile::upper_95)
      .def_property_readonly("values", [](const Profile& p) { return array_of(p.values); })
      .def_property_readonly("delta_chi2", [](const Profile& p) { return array_of(p.delta_chi2); });
  py::class_<BootstrapSpread>(module, "BootstrapSpread", "Spread of a parameter over the draws.")
      .def_readonly("parameter", &BootstrapSpread::parameter)
      .def_readonly("sigma", &BootstrapSpread::sigma)
      .def_readonly("lower_95", &BootstrapSpread::lower_95)
      .def_readonly("upper_95", &BootstrapSpread::upper_95);
  py::class_<Bootstrap>(module, "Bootstrap", "Error bars from fits to resampled residuals.")
      .def_readonly("draws", &Bootstrap::draws, "0: not asked for")
      .def_readonly("failed", &Bootstrap::failed)
      .def_readonly("block_s", &Bootstrap::block_s)
      .def_readonly("parameters", &Bootstrap::parameters);
}

void add_fit_values(py::module_& module) {
  using data::Fit;
  add_fit_parts(module);
  add_error_bars(module);
  py::class_<Fit>(module, "FitValue")
      .def_readonly("model", &Fit::model)
      .def_readonly("converged", &Fit::converged)
      .def_property_readonly("outcome", [](const Fit& f) { return name(f.outcome); })
      .def_readonly("reason", &Fit::reason)
      .def_property_readonly("verdict", [](const Fit& f) { return name(f.verdict); })
      .def_readonly("verdict_words", &Fit::verdict_words)
      .def_readonly("start_path", &Fit::start_path)
      .def_readonly("parameters", &Fit::parameters)
      .def_readonly("covariance_names", &Fit::covariance_names)
      .def_property_readonly("covariance", [](const Fit& f) { return array_of(f.covariance); })
      .def_readonly("chi2", &Fit::chi2)
      .def_readonly("dof", &Fit::dof)
      .def_readonly("noise_scale", &Fit::noise_scale)
      .def_readonly("aicc", &Fit::aicc)
      .def_readonly("bic", &Fit::bic)
      .def_readonly("whiteness_p", &Fit::whiteness_p)
      .def_readonly("correlation_time_s", &Fit::correlation_time_s)
      .def_readonly("rank", &Fit::rank)
      .def_readonly("condition", &Fit::condition)
      .def_readonly("null_vectors", &Fit::null_vectors)
      .def_readonly("broken_degeneracies", &Fit::broken_degeneracies)
      .def_readonly("integration_error_sigma", &Fit::integration_error_sigma)
      .def_readonly("time_origin_s", &Fit::time_origin_s)
      .def_readonly("arcs", &Fit::arcs)
      .def_readonly("comparison", &Fit::comparison)
      .def_readonly("recommendation", &Fit::recommendation)
      .def_readonly("profiles", &Fit::profiles)
      .def_readonly("bootstrap", &Fit::bootstrap)
      .def_readonly("warnings", &Fit::warnings)
      .def_readonly("inputs", &Fit::inputs)
      .def_readonly("versions", &Fit::versions)
      .def_readonly("seed", &Fit::seed)
      .def_readonly("scene_toml", &Fit::scene_toml)
      .def_property_readonly("text", [](const Fit& f) { return data::fit_text(f, "fit"); });
  module.def("read_fit", [](const fs::path& path) { return data::read_fit(path); });
  module.def("parse_fit", [](const std::string& text) { return data::parse_fit(text, "fit"); });
  module.def("write_fit", [](const Fit& fit, const fs::path& path) { data::write_fit(fit, path); });
}

void add_scene(py::module_& module) {
  py::class_<SceneValue>(module, "SceneValue")
      .def(py::init())
      .def_static("load", [](const fs::path& name) { return SceneValue{tools::load_scene(name)}; })
      .def_static("parse",
                  [](const std::string& toml, const std::string& where) {
                    return SceneValue{data::parse_scene(toml, where)};
                  })
      .def_static("of_tables", &scene_of_tables)
      .def("with_run",
           [](SceneValue value, std::optional<double> until_s, std::optional<double> rate_hz,
              std::optional<double> tolerance, const std::string& model,
              const std::string& integrator) {
             data::RunSettings& run = value.scene.run;
             run.until_s = until_s.value_or(run.until_s);
             run.rate_hz = rate_hz.value_or(run.rate_hz);
             run.tolerance = tolerance.value_or(run.tolerance);
             if (!model.empty()) value.scene.model.name = model;
             if (!integrator.empty()) run.integrator = integrator;
             return SceneValue{checked(value.scene)};
           })
      .def_property_readonly("toml",
                             [](const SceneValue& value) { return data::to_toml(value.scene); });
  module.def("fitted_scene", [](const data::Fit& fit, std::size_t arc) {
    return SceneValue{tools::fitted_scene(fit, arc)};
  });
  module.def("bundled_scenes", [] {
    std::map<std::string, std::string> names;
    for (const tools::BundledScene& scene : tools::bundled_scenes())
      names.emplace(scene.name, scene.summary());
    return names;
  });
}

py::dict texts_of(const tools::Checksums& checksums) {
  py::dict dict;
  for (const auto& [name, digest] : checksums) dict[text_of(name)] = digest;
  return dict;
}

// Kept for as long as the module is.
PyObject *error_type = nullptr, *input_error_type = nullptr, *numerical_error_type = nullptr;

/// pybind11 would leave a message that names a file in no UTF-8 empty.
void raise(std::exception_ptr thrown) {
  const auto set = [](PyObject* type, const std::exception& error) {
    PyErr_SetObject(type, text_of(error.what()).ptr());
  };
  try {
    std::rethrow_exception(std::move(thrown));
  } catch (const InputError& error) {
    set(input_error_type, error);
  } catch (const NumericalError& error) {
    set(numerical_error_type, error);
  } catch (const Error& error) {
    set(error_type, error);
  }
}

void add_errors(py::module_& module) {
  const auto added = [&](const char* name, const py::object& bases) {
    const py::exception<Error> type(module, name, bases);
    return type.inc_ref().ptr();
  };
  error_type = added("Error", py::reinterpret_borrow<py::object>(PyExc_Exception));
  const py::handle base(error_type);
  input_error_type = added("InputError", py::make_tuple(base, py::handle(PyExc_ValueError)));
  numerical_error_type =
      added("NumericalError", py::make_tuple(base, py::handle(PyExc_ArithmeticError)));
  py::register_exception_translator(&raise);
}

/// Of the files behind a fit; what is handed in comes back with one more.
void add_provenance(py::module_& module) {
  using tools::Checksums;
  module.def("with_scene", [](Checksums known, const fs::path& named, const SceneValue& scene) {
    tools::add_scene(known, named, scene.scene);
    return texts_of(known);
  });
  module.def("with_track", [](Checksums known, const fs::path& file) {
    tools::add_track(known, file);
    return texts_of(known);
  });
  module.def("with_recording", [](Checksums known, const std::string& source,
                                  const std::string& sha256, const fs::path& track) {
    tools::add_recording(known, source, sha256, track.string());
    return texts_of(known);
  });
  module.def("check_made_from", &tools::check_made_from);
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  tools::set_talk(tools::Talk::quiet);
  fitting::silence_solver_log();
  add_errors(module);
  module.attr("__version__") = TROCHOID_VERSION;
  add_scene(module);
  add_fit_values(module);
  module.def("read_track", [](const fs::path& path) { return dict_of(data::read_track(path)); });
  module.def("write_track", [](const py::dict& file, const fs::path& path) {
    data::write_track(file_of(file), path);
  });
  add_provenance(module);
  module.def("check_outputs", &tools::check_outputs);
  module.def("simulate", &simulate);
  module.def("fit", &fit);
  module.def("predict", &predict);
#ifdef TROCHOID_HAS_TRACKING
  module.def("track", &track);
  module.def("overlay", &overlay);
#endif
}

}  // namespace trochoid::python
