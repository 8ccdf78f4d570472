#!/usr/bin/env python3
"""The README's figures made again from Python; the cells (# %%) open as a notebook in most editors.

    PYTHONPATH=build/dev/python tools/python/examples/figures.py [FOLDER]
"""

# %% Where things are
import pathlib
import sys
import time

import numpy as np

import trochoid

samples = pathlib.Path(__file__).resolve().parents[3] / "data" / "samples"
out = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "figures")
out.mkdir(parents=True, exist_ok=True)


def table(path):
    """Columns of a CSV by name."""
    return np.genfromtxt(path, delimiter=",", names=True)


# %% Centre of mass in the bundled recordings, against their truth
files = {}
for sample in sorted(folder for folder in samples.iterdir() if folder.is_dir()):
    files[sample.name] = file = trochoid.track(sample / "video.mp4", sample / "scene.toml")
    track = file.tracks[0]
    truth = table(sample / "truth.csv")
    seen = truth[np.searchsorted(truth["frame"], track.frame)]
    error_px = track.centre_px - np.column_stack([seen["x_px"], seen["y_px"]])
    print(f"{sample.name}: {file.summary['found']} of {file.summary['frames']} frames, "
          f"rms {np.sqrt(np.mean(np.sum(error_px**2, axis=1))):.3f} px")

# %% The top of the second one: parameters with error bars, and its path over the recording
sample = samples / "s5_top_marker"
fit = trochoid.fit(files[sample.name], sample / "scene.toml")
print(fit)
for name in ("a_1_s2", "b_1_s", "l_m"):
    print(f"  {fit[name]}")
trochoid.overlay(sample / "video.mp4", files[sample.name], fit, scene=sample / "scene.toml",
                 still=out / "top_path.jpg")
arc = trochoid.predict(fit, files[sample.name])[0]
track = files[sample.name].tracks[0]
residual_m = arc.centre_m[np.searchsorted(arc.t_s, track.t_s), :2] - track.centre_m
print(f"  rms of the residuals {1e6 * np.sqrt(np.mean(residual_m**2)):.1f} um")

# %% A ring that turns retrograde: its path is drawn below
ring = trochoid.simulate("ring_retrograde")
x_m, y_m = ring["x_m"], ring["y_m"]
print(f"ring_retrograde: {ring.sentence} {len(x_m)} rows, error estimate {ring.error_estimate_m:.0e} m")

# %% Tops fitted without a guess: noise of 1 % of the path, random scenes
draw = np.random.default_rng(1)
found, times_ms = 0, []
for _ in range(100):
    b_1_s, theta_rad = np.exp(draw.uniform(np.log(0.5), np.log(40.0))), draw.uniform(0.25, 1.2)
    a_1_s2 = b_1_s**2 * np.exp(draw.uniform(np.log(0.05), np.log(0.75)))
    nutation_s = 2 * np.pi / b_1_s
    run = trochoid.simulate({
        "body": {"kind": "top", "mass_kg": 0.1, "l_m": 0.03, "I_kg_m2": 0.1 * 9.81 * 0.03 / a_1_s2,
                 "Is_kg_m2": 1.5e-4},
        "support": {"kind": "pivot"}, "model": {"name": "top"},
        "start": {"theta_rad": theta_rad,
                  "omega_s_rad_s": b_1_s * 0.1 * 9.81 * 0.03 / a_1_s2 / 1.5e-4},
        "run": {"until_s": 2.5 * nutation_s, "rate_hz": 149 / (2.5 * nutation_s)}})
    path_m = np.column_stack([run["x_m"], run["y_m"]])
    sigma_m = 0.01 * np.sqrt(np.mean(np.sum((path_m - path_m.mean(axis=0)) ** 2, axis=1)))
    noisy = trochoid.Track(run["t_s"], path_m + draw.normal(0.0, sigma_m, path_m.shape),
                           np.tile(sigma_m**2 * np.eye(2), (len(path_m), 1, 1)))
    start = time.perf_counter()
    result = trochoid.fit(noisy, model="top")
    times_ms.append(1e3 * (time.perf_counter() - start))
    found += abs(result["l_m"].value - 0.03) < 4 * result["l_m"].sigma
print(f"tops without a guess: {found} of 100 within 4 sigma, median {np.median(times_ms):.1f} ms")

# %% Pictures, where matplotlib is at hand
try:
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
except ImportError:
    print("no matplotlib: no picture of the ring's path")
else:
    figure, axes = pyplot.subplots(figsize=(6, 6))
    axes.plot(1e3 * x_m, 1e3 * y_m, linewidth=0.8)
    axes.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", title="ring_retrograde")
    figure.savefig(out / "retrograde_path.svg")
