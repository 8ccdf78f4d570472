"""Track, simulate and fit spinning and rolling discs and rings.

The functions are called like the commands of the program and do the same:

    track(video, scene)          recording -> TrackFile: centre of mass in every frame, with covariance
    fit(track, scene)            track -> Fit: parameters with error bars, no first guess needed
    overlay(video, track, fit)   prediction and observation drawn into the recording
    simulate(scene)              scene -> Trajectory: the model alone

Everything is SI and says so in its name (``t_s``, ``centre_m``); arrays are numpy's. The table frame has
z up and the floor at z = 0; pixels have x right, y down, pixel centres at whole numbers.

A scene may be given as the path of a TOML file, the name of a bundled scene (``scenes()``), a dict of
dicts with the keys of the TOML file, or a ``Scene``. What is wrong with an input raises ``InputError``
(a ``ValueError``), what cannot be computed ``NumericalError`` (an ``ArithmeticError``), both with one line
that names the place, the value and the remedy. Work runs without the GIL; Ctrl-C ends it, in an
executor's threads too, a fit at its next minimisation and a simulation when it is done.
"""

from __future__ import annotations

import dataclasses
import os
import reprlib
from typing import (Any, Callable, ItemsView, Iterator, KeysView, Mapping, Optional, Sequence, Union,
                    ValuesView)

import numpy as np

from . import _core
from ._core import (Arc, Bootstrap, BootstrapSpread, BrokenDegeneracy, Error, InputError, ModelScore,
                    NullVector, NumericalError, Parameter, Profile)

__version__ = _core.__version__
__all__ = ["track", "fit", "overlay", "simulate", "predict", "scenes", "read_track", "read_fit",
           "Scene", "Track", "TrackFile", "Trajectory", "Fit", "PredictedArc", "OverlayFrames",
           "Parameter", "Arc", "ModelScore", "NullVector", "BrokenDegeneracy", "Profile", "Bootstrap",
           "BootstrapSpread", "Error", "InputError", "NumericalError"]

Path = Union[str, "os.PathLike[str]"]
Moment = Union[None, str, float, int]


def _wrong(name: str, value: Any, right: str) -> InputError:
    return InputError(f"{name} = {reprlib.repr(value)} must be {right}")


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise _wrong(name, value, "a text (str)")
    return value


def _flag(name: str, value: Any) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise _wrong(name, value, "True or False")
    return bool(value)


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise _wrong(name, value, "a number")
    return float(value)


def _whole(name: str, value: Any, most: int = 2**31 - 1) -> int:
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or not 0 <= value <= most:
        raise _wrong(name, value, f"a whole number in 0..{most}")
    return int(value)


def _path(name: str, value: Any) -> str:
    if not isinstance(value, (str, bytes, os.PathLike)):
        raise _wrong(name, value, "a path")
    return os.fsdecode(value)


def _optional(check: Callable[..., Any], name: str, value: Any) -> Any:
    return None if value is None else check(name, value)


def _outputs(inputs: Sequence[Any], **named: Optional[Path]) -> list[Optional[str]]:
    """Before the work, so that a wrong name costs no time and none of the files that are read."""
    paths = [_optional(_path, name, value) for name, value in named.items()]
    _core.check_outputs([path for path in paths if path is not None],
                        [os.fsdecode(i) for i in inputs if isinstance(i, (str, bytes, os.PathLike))])
    return paths


def _unmasked(name: str, value: Any) -> Any:
    """What is masked is unknown: NaN, of frames -1."""
    if not np.ma.isMaskedArray(value):
        return value
    return np.ma.filled(value, -1) if name == "frame" else np.ma.filled(value.astype(float), np.nan)


def _unknown(value: Any) -> bool:
    """None, or an array of nothing but NaN or, of frames, -1: what a file does not hold."""
    if not isinstance(value, np.ndarray):
        return value is None
    return bool(np.all(np.isnan(value) if value.dtype.kind == "f" else value == -1))


def _same(a: Any, b: Any) -> bool:
    if (a is None) != (b is None):
        return _unknown(a) and _unknown(b)
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        a, b = np.asarray(a), np.asarray(b)
        return np.array_equal(a, b, equal_nan=a.dtype.kind == b.dtype.kind == "f")
    return bool(a == b)


class _Record:
    """Equal where all fields are, arrays element by element; NaN, the unknown, equals NaN."""

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        names = [field.name for field in dataclasses.fields(self)]
        return all(_same(_unmasked(name, getattr(self, name)), _unmasked(name, getattr(other, name)))
                   for name in names)


def _toml_text(text: str) -> str:
    return '"' + "".join("\\" + c if c in '"\\' else f"\\u{ord(c):04x}" if c < " " or c == "\x7f" else c
                         for c in text) + '"'


def _toml_key(key: Any) -> str:
    """As it is where it may be: messages then show it so."""
    text = _text("key", key)
    return text if text.replace("_", "").isalnum() and text.isascii() else _toml_text(text)


def _toml_value(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, os.PathLike):
        value = os.fsdecode(value)
    if isinstance(value, str):
        return _toml_text(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_toml_key(k)} = {_toml_value(v)}" for k, v in value.items()) + "}"
    if isinstance(value, (Sequence, np.ndarray)):
        return "[" + ", ".join(_toml_value(v) for v in value) + "]"
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    raise InputError(f"scene: a {type(value).__name__} cannot be written in a scene")


def _scene_of_dict(tables: Mapping[str, Mapping[str, Any]]) -> "_core.SceneValue":
    lines, owners = [], []  # of each line: the table it belongs to
    for name, table in tables.items():
        if not isinstance(table, Mapping):
            raise InputError(f"scene: '{name}' is not a table; give a dict of dicts")
        lines += [f"[{name}]"] + [f"{_toml_key(key)} = {_toml_value(value)}"
                                  for key, value in table.items()]
        owners += [name] * (1 + len(table))
    return _core.SceneValue.of_tables("\n".join(lines) + "\n", owners)


class Scene:
    """What is known beforehand: body, support, camera, model, start, run, fit (docs/formats.md).

    ``Scene("ring.toml")``, ``Scene("thesis-base")``, ``Scene({"body": {"radius_m": 0.03}})``.
    """

    __slots__ = ("_value", "__weakref__")

    def __init__(self, scene: Union[None, Path, Mapping, "Scene"] = None):
        if scene is None:
            self._value = _core.SceneValue()
        elif isinstance(scene, Scene):
            self._value = scene._value
        elif isinstance(scene, Mapping):
            self._value = _scene_of_dict(scene)
        else:
            self._value = _core.SceneValue.load(_path("scene", scene))

    @classmethod
    def of_fit(cls, fit: "Fit", arc: int = 0) -> "Scene":
        """The scene of a fit with its start and coefficients replaced by what was found, so that
        ``simulate`` runs the motion on; time 0 is where that arc begins."""
        if not isinstance(fit, Fit):
            raise _wrong("fit", fit, "a Fit")
        scene = cls()
        scene._value = _core.fitted_scene(fit._value, _whole("arc", arc))
        return scene

    @classmethod
    def from_toml(cls, text: str) -> "Scene":
        """A scene from the text of a scene file."""
        scene = cls()
        scene._value = _core.SceneValue.parse(_text("text", text), "scene text")
        return scene

    @property
    def toml(self) -> str:
        """The scene as the text of a scene file."""
        return self._value.toml

    def __repr__(self) -> str:
        return f"Scene.from_toml({self.toml!r})"

    def __eq__(self, other: object) -> bool:
        return self.toml == other.toml if isinstance(other, Scene) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.toml)

    def __reduce__(self) -> tuple[Any, ...]:
        return Scene.from_toml, (self.toml,)


def scenes() -> dict[str, str]:
    """Names of the bundled scenes with a sentence about each."""
    return _core.bundled_scenes()


@dataclasses.dataclass(eq=False, repr=False)
class Track(_Record):
    """The path of one body; n samples, strictly increasing in time; frames without the body have none.

    Only ``t_s`` and ``centre_m`` are needed for a fit: ``Track(t_s, centre_m)``. Unknown is NaN or
    masked; samples without a position are gaps, which `fit` leaves out and counts among its ``warnings``.
    """

    t_s: np.ndarray                                #: (n,) presentation time [s]
    centre_m: Optional[np.ndarray] = None          #: (n, 2) centre of mass, table frame [m]
    covariance_m2: Optional[np.ndarray] = None     #: (n, 2, 2) its covariance [m^2]
    frame: Optional[np.ndarray] = None             #: (n,) 0-based number of the frame; -1: none
    centre_px: Optional[np.ndarray] = None         #: (n, 2) image of the centre of mass [px]
    theta_rad: Optional[np.ndarray] = None         #: (n,) tilt: axis against the vertical [rad]
    sigma_theta_rad: Optional[np.ndarray] = None
    phi_rad: Optional[np.ndarray] = None           #: (n,) precession, unwrapped [rad]
    sigma_phi_rad: Optional[np.ndarray] = None
    psi_rad: Optional[np.ndarray] = None           #: (n,) spin, unwrapped [rad]
    sigma_psi_rad: Optional[np.ndarray] = None
    quality: Optional[np.ndarray] = None           #: (n,) 0 doubtful .. 1 sure
    object: int = 0                                #: number of the body in the recording

    def __len__(self) -> int:
        return len(self.t_s)

    def __repr__(self) -> str:
        span = f", {self.t_s[0]:.6g} .. {self.t_s[-1]:.6g} s" if len(self) else ""
        return f"<Track of object {self.object}: {len(self)} samples{span}>"


@dataclasses.dataclass(eq=False, repr=False)
class TrackFile(_Record):
    """The tracks of a recording and where they come from."""

    tracks: list[Track]
    source: str = ""              #: file name of the recording
    source_sha256: str = ""
    camera: str = ""              #: how metres were obtained, in words
    made_by: str = ""
    angles_folded: bool = False   #: faces look alike: theta is min(theta, pi - theta)
    notes: list[str] = dataclasses.field(default_factory=list)
    summary: Optional[dict[str, Any]] = None  #: of track(): frames, found, lost, doubtful, damaged

    def __repr__(self) -> str:
        return f"<TrackFile of {self.source or 'no recording'}: {', '.join(map(repr, self.tracks))}>"

    def write(self, path: Path) -> None:
        """Writes the track file (CSV), whole or not at all."""
        _core.write_track(_file_dict(self), _path("path", path))


def _track_dict(track: Track) -> dict[str, Any]:
    if not isinstance(track, Track):
        raise _wrong("track", track, "a Track")
    arrays = {name: _unmasked(name, value) for name, value in vars(track).items()}
    return {**arrays, "object": _whole("object", track.object)}


def _file_dict(file: TrackFile) -> dict[str, Any]:
    fields: dict[str, Any] = {name: _text(name, getattr(file, name)) for name in
                              ("source", "source_sha256", "camera", "made_by")}
    fields["angles_folded"] = _flag("angles_folded", file.angles_folded)
    for name in ("notes", "tracks"):
        if not isinstance(getattr(file, name), (list, tuple)):
            raise _wrong(name, getattr(file, name), "a list")
    fields["notes"] = [_text("notes", note) for note in file.notes]
    return {**fields, "tracks": [_track_dict(track) for track in file.tracks]}


def _file(values: dict[str, Any], summary: Optional[dict[str, Any]] = None) -> TrackFile:
    tracks = [Track(**track) for track in values.pop("tracks")]
    return TrackFile(tracks=tracks, summary=summary, **values)


def read_track(path: Path) -> TrackFile:
    """Reads a track CSV; a bare ``t_s,x_m,y_m`` will do."""
    return _file(_core.read_track(_path("path", path)))


def _moment(name: str, value: Moment) -> str:
    if value is None:
        return ""
    return value if isinstance(value, str) else str(_number(name, value))


def _needs_tracking(function: str) -> None:
    if not hasattr(_core, function):
        raise Error(f"{function}: this trochoid was built without tracking")


def track(video: Path, scene: Union[None, Path, Mapping, Scene] = None, *,
          camera: Optional[Path] = None, objects: Optional[int] = None, from_: Moment = None,
          to: Moment = None, at_px: Optional[tuple[float, float]] = None,
          rate_hz: Optional[float] = None, effort: str = "normal",
          edges: Optional[Path] = None, smooth: Optional[Path] = None,
          output: Optional[Path] = None) -> TrackFile:
    """Follows the moving bodies of a recording (``trochoid track``).

    video    file, folder of images or series (``img/%04d.png``)
    camera   camera file, replaces the scene's
    objects  number of moving bodies [1]
    from_, to  first and last moment: seconds (1.5) or a frame ("f120")
    at_px    a point (x, y) [px] on the body in the first frame used
    rate_hz  true frame rate [Hz] where the file's is not (slow motion)
    effort   how closely the outline is looked at: "quick", "normal" or "exact"
    edges    write the accepted edge points into this CSV
    smooth   write smoothed positions and velocities [m, m/s] into this CSV; never fit these
    output   write the track into this CSV
    """
    _needs_tracking("track")
    if at_px is not None:
        if not isinstance(at_px, (Sequence, np.ndarray)) or len(at_px) != 2:
            raise _wrong("at_px", at_px, "a point (x, y)")
        at_px = (_number("at_px", at_px[0]), _number("at_px", at_px[1]))
    output, edges, smooth = _outputs([video, scene, camera], output=output, edges=edges, smooth=smooth)
    options = {"objects": _optional(_whole, "objects", objects), "from": _moment("from_", from_),
               "to": _moment("to", to), "at_px": at_px,
               "rate_hz": _optional(_number, "rate_hz", rate_hz), "effort": _text("effort", effort),
               "edges": edges, "smooth": smooth}
    values, summary = _core.track(_path("video", video), Scene(scene)._value,
                                  _optional(_path, "camera", camera), options)
    file = _file(values, summary)
    if output is not None:
        file.write(output)
    return file


Tracks = Union[Path, Track, TrackFile, "Trajectory", Sequence[Union[Path, Track, TrackFile, "Trajectory"]]]


class _Given:
    """Tracks in the order they are given, and the checksums of the files behind them."""

    def __init__(self, given: Tracks):
        self.tracks: list[Track] = []
        self.inputs: dict[str, str] = {}
        self._add(given)

    def _add(self, given: Tracks) -> None:
        if isinstance(given, (str, os.PathLike)):
            path = os.fsdecode(given)
            file = read_track(path)
            self.inputs = _core.with_track(self.inputs, path)
            self._add_file(file, path)
        elif isinstance(given, Track):
            self._add_track(given)
        elif isinstance(given, TrackFile):
            self._add_file(given, f"track {len(self.tracks)}")
        elif isinstance(given, Trajectory):
            self._add_track(Track(given["t_s"], np.column_stack([given["x_m"], given["y_m"]])))
        elif isinstance(given, Sequence):
            for one in given:
                self._add(one)
        else:
            raise InputError(f"tracks: a {type(given).__name__} is no track, track file or path")

    def _add_file(self, file: TrackFile, name: str) -> None:
        self.inputs = _core.with_recording(self.inputs, _text("source", file.source),
                                           _text("source_sha256", file.source_sha256), name)
        for track in file.tracks:
            self._add_track(track)

    def _add_track(self, track: Track) -> None:
        if any(track is one for one in self.tracks):
            raise InputError(f"tracks: {track!r} is given twice; a recording counts once")
        self.tracks.append(track)


class Fit:
    """Parameters of a model with error bars, as `fit` finds and ``read_fit`` reads them.

    ``fit["radius_m"]`` is a ``Parameter`` (value, sigma, unit, status, identifiable, note); the other
    attributes are those of the JSON file (docs/formats.md): model, converged, outcome, reason, verdict,
    verdict_words, start_path, chi2, dof, noise_scale, aicc, bic, whiteness_p, correlation_time_s, rank,
    condition, null_vectors, broken_degeneracies, integration_error_sigma, time_origin_s, arcs, comparison,
    recommendation, profiles, bootstrap, warnings, inputs, versions, seed, scene_toml.

    ``verdict`` is what the fit is worth: good, good_correlated, weak, doubtful, no_feature or unexplained.
    """

    def __init__(self, value: "_core.FitValue"):
        self._value = value

    @property
    def parameters(self) -> dict[str, Parameter]:
        """Parameters by name; those of arc i > 0 end in "@i"."""
        return {parameter.name: parameter for parameter in self._value.parameters}

    @property
    def covariance(self) -> np.ndarray:
        """(k, k) covariance of the k free parameters ``covariance_names``."""
        return self._value.covariance

    def __contains__(self, name: object) -> bool:
        return name in self.parameters

    def __iter__(self) -> Iterator[str]:
        return iter(self.parameters)

    def __len__(self) -> int:
        return len(self._value.parameters)

    def keys(self) -> KeysView[str]:
        """Names of the parameters."""
        return self.parameters.keys()

    def values(self) -> ValuesView[Parameter]:
        """The parameters."""
        return self.parameters.values()

    def items(self) -> ItemsView[str, Parameter]:
        """Pairs of name and parameter."""
        return self.parameters.items()

    def __getitem__(self, name: str) -> Parameter:
        parameters = self.parameters
        try:
            return parameters[name]
        except KeyError:
            raise KeyError(f"{name}; there are {', '.join(parameters)}") from None

    def __array__(self, dtype: Any = None, copy: Optional[bool] = None) -> np.ndarray:
        """One object, as numpy takes a dict; by itself numpy would make a list of the names."""
        one = np.empty((), dtype=object)
        one[()] = self
        return one

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or not hasattr(self._value, name):
            raise AttributeError(f"a Fit has no attribute {name!r}")
        return getattr(self._value, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "_value":
            raise AttributeError("a Fit is what was found and cannot be changed")
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(n for n in dir(self._value) if not n.startswith("_"))})

    def __repr__(self) -> str:
        worth = self.verdict or self.outcome  # another tool's file may lack the verdict
        return f"<Fit of {self.model}: {worth}, chi2 {self.chi2:.6g} for {self.dof}>"

    def __eq__(self, other: object) -> bool:
        return self._value.text == other._value.text if isinstance(other, Fit) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._value.text)

    def __reduce__(self) -> tuple[Any, ...]:
        return _fit_of_text, (self._value.text,)

    def write(self, path: Path) -> None:
        """Writes the fit file (JSON), whole or not at all."""
        _core.write_fit(self._value, _path("path", path))


def _fit_of_text(text: str) -> Fit:
    return Fit(_core.parse_fit(text))


def read_fit(path: Path) -> Fit:
    """Reads a fit JSON."""
    return Fit(_core.read_fit(_path("path", path)))


def _fit(given: Union[Path, Fit], tracks: Any) -> Fit:
    """A fit to be shown over tracks: of a file the fit tells whether it was made from it."""
    fit = given if isinstance(given, Fit) else Fit(_core.read_fit(_path("fit", given)))
    if isinstance(tracks, (str, os.PathLike)):
        name = "fit" if isinstance(given, Fit) else os.fsdecode(given)
        _core.check_made_from(fit._value, name, os.fsdecode(tracks))
    return fit


def fit(tracks: Tracks, scene: Union[None, Path, Mapping, Scene] = None, *, model: str = "",
        from_: Moment = None, to: Moment = None, free_pivot: bool = False, compare: bool = False,
        profile: bool = False, bootstrap: int = 0, threads: int = 0, seed: int = 1,
        start: Optional[Mapping[str, float]] = None, output: Optional[Path] = None) -> Fit:
    """Fits model parameters to one or more tracks of a body (``trochoid fit``).

    tracks     a path, Track, TrackFile or Trajectory, or a list (several recordings of one body)
    model      top, smooth, rolling, sliding, puck, pivot or auto; overrides the scene's
    from_, to  first and last sample: seconds (1.5) or a frame ("f120")
    free_pivot fit the pivot's x and y (top); else it is where the scene says, or at 0, 0
    compare    try the models that make sense, fit the simplest that suffices
    profile    profile likelihoods of all parameters but places and angles at the start
    bootstrap  number of fits to resampled residuals, 0: none
    threads    at most so many, 0: all cores; the answer does not depend on it
    seed       of the draws of the bootstrap
    start      a first guess by parameter name; seldom needed
    output     write the fit into this JSON

    An unwelcome answer is not an exception: look at ``converged``, ``verdict`` and ``warnings``.
    """
    tracks = list(tracks) if isinstance(tracks, Iterator) else tracks
    given = _Given(tracks)
    if scene is None and not model:
        raise InputError("fit: give a scene, or model='top' (the only one that needs no body)")
    resolved = Scene(scene)
    if scene is not None:
        named = os.fspath(scene) if isinstance(scene, (str, os.PathLike)) else ""
        given.inputs = _core.with_scene(given.inputs, named, resolved._value)
    if not isinstance(start, (type(None), Mapping)):
        raise _wrong("start", start, "a dict of numbers by parameter name")
    first_guess = {_text("start", name): _number(f"start[{name!r}]", value)
                   for name, value in (start or {}).items()}
    options = {"model": _text("model", model), "from": _moment("from_", from_),
               "to": _moment("to", to), "free_pivot": _flag("free_pivot", free_pivot),
               "profile": _flag("profile", profile), "bootstrap": _whole("bootstrap", bootstrap, most=100000),
               "threads": _whole("threads", threads), "seed": _whole("seed", seed, most=2**64 - 1),
               "start": first_guess}
    one = isinstance(tracks, (str, Track, TrackFile, Trajectory)) or not isinstance(tracks, Sequence)
    files = [tracks] if one else list(tracks)
    output, = _outputs([scene, *files], output=output)
    result = Fit(_core.fit([_track_dict(t) for t in given.tracks], resolved._value,
                           _flag("compare", compare), options, given.inputs))
    if output is not None:
        result.write(output)
    return result


@dataclasses.dataclass(eq=False)
class PredictedArc(_Record):
    """The fitted model's path over one arc, m moments: every sample's and several in between."""

    object: int
    t_s: np.ndarray         #: (m,) [s]
    centre_m: np.ndarray    #: (m, 3) centre of mass, table frame [m]
    angles_rad: np.ndarray  #: (m, 3) theta, phi, psi [rad]; NaN where the model has none
    ended: str              #: why it stops before the arc does, else empty


def _shown_file(track: Any) -> TrackFile:
    """The track file a fit or a recording is shown over: of a path with all its header says."""
    if isinstance(track, (str, os.PathLike)):
        return read_track(track)
    return track if isinstance(track, TrackFile) else TrackFile(_Given(track).tracks)


def predict(fit: Union[Path, Fit], tracks: Union[Path, Track, TrackFile], *,
            fit_track: Optional[int] = None) -> list[PredictedArc]:
    """Replays a fit over the track it was made from; of a fit of several, ``fit_track`` says which of
    them that is, counted from 0."""
    arcs = _core.predict(_fit(fit, tracks)._value, _file_dict(_shown_file(tracks)),
                         _optional(_whole, "fit_track", fit_track))
    return [PredictedArc(**arc) for arc in arcs]


@dataclasses.dataclass(eq=False)
class OverlayFrames(_Record):
    """Picture k of an overlay shows frame[k] of the recording, at t_s[k]; frames come again where the
    recording has lost the next."""

    frame_rate_hz: float   #: of the overlay
    slowed: float          #: so many times slower than it happened
    frame: np.ndarray      #: (k,)
    t_s: np.ndarray        #: (k,) [s]


def overlay(video: Path, track: Union[Path, Track, TrackFile], fit: Union[None, Path, Fit] = None, *,
            scene: Union[None, Path, Mapping, Scene] = None, camera: Optional[Path] = None,
            output: Optional[Path] = None, still: Optional[Path] = None, from_: Moment = None,
            to: Moment = None, slow: float = 0.0,
            fit_track: Optional[int] = None) -> OverlayFrames:
    """Draws observed and predicted path into the recording (``trochoid overlay``).

    fit     without it only the observation is drawn
    scene   default: the one stored in the fit
    output  overlay video (.mp4);  still: one picture of the whole path (.png, .jpg)
    slow    play so many times slower; 0: at most 60 pictures a second
    """
    _needs_tracking("overlay")
    if output is None and still is None:
        raise InputError("overlay: nothing to write; give output='overlay.mp4', still='path.png' or both")
    output, still = _outputs([video, track, fit, scene, camera], output=output, still=still)
    if _number("slow", slow) != 0.0 and not 0.01 <= slow <= 1000.0:
        raise _wrong("slow", slow, "0 or a number in 0.01..1000")
    options = {"output": output or "", "still": still or "",
               "from": _moment("from_", from_), "to": _moment("to", to),
               "slow": float(slow),
               "fit_file": fit if isinstance(fit, (str, os.PathLike)) else "",
               "track_file": track if isinstance(track, (str, os.PathLike)) else "",
               "fit_track": _optional(_whole, "fit_track", fit_track)}
    frames = _core.overlay(_path("video", video), _file_dict(_shown_file(track)),
                           _fit(fit, track)._value if fit is not None else None,
                           Scene(scene)._value if scene is not None else None,
                           _optional(_path, "camera", camera), options)
    return OverlayFrames(**frames)


@dataclasses.dataclass(eq=False, repr=False)
class Trajectory(_Record):
    """A finished run. ``run["x_m"]`` is the column of that name, (rows,)."""

    model: str
    integrator: str
    integrator_reason: str
    columns: list[str]           #: names with units
    values: np.ndarray           #: (rows, columns), uniform in time up to the end of the run
    events: list[tuple[float, str]]  #: (t_s, name): slip, stick, flat ...
    outcome: str                 #: why the run ended: reached_end, flat, rim_switch, lift_off ...
    sentence: str                #: the same for people
    end_s: float
    error_estimate_m: float      #: of the path; NaN where the centre of mass stays where it is
    error_estimate_rad: float    #: of the axis' direction; of the spin angle where it is upright
    steps: int
    evaluations: int             #: of the right-hand side

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        return (f"<Trajectory of {self.model} by {self.integrator}: {len(self)} rows to "
                f"{self.end_s:.6g} s, {self.outcome}>")

    def __getitem__(self, column: str) -> np.ndarray:
        try:
            return self.values[:, self.columns.index(column)]
        except ValueError:
            raise KeyError(f"{column}; there are {', '.join(self.columns)}") from None


def simulate(scene: Union[Path, Mapping, Scene, Fit], *, until_s: Optional[float] = None,
             rate_hz: Optional[float] = None, tolerance: Optional[float] = None, model: str = "",
             integrator: str = "", output: Optional[Path] = None) -> Trajectory:
    """Runs a scene's model (``trochoid simulate``); what is given overrides the scene.

    scene             or a Fit: the motion it found, ``Scene.of_fit(fit)``
    until_s, rate_hz  end time [s] and output rate [Hz]
    tolerance         of the integration
    integrator        auto, dop853, taylor, radau, cvode-adams, cvode-bdf or arkode
    output            write the trajectory into this CSV
    """
    given = Scene.of_fit(scene) if isinstance(scene, Fit) else Scene(scene)
    value = given._value.with_run(
        _optional(_number, "until_s", until_s), _optional(_number, "rate_hz", rate_hz),
        _optional(_number, "tolerance", tolerance), _text("model", model),
        _text("integrator", integrator))
    output, = _outputs([scene], output=output)
    return Trajectory(**_core.simulate(value, output or ""))
