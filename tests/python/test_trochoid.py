"""The Python package against closed forms, planted parameters and a bundled recording."""

import _thread
import concurrent.futures
import inspect
import json
import os
import pathlib
import pickle
import signal
import tempfile
import threading
import time
import types
import unittest
import unittest.mock

import numpy as np

import trochoid

# Started in the background, Python inherits an ignored SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)

SAMPLE = pathlib.Path(os.environ["TROCHOID_SAMPLES"]) / "s1_disc_paper"
HAS_TRACKING = hasattr(trochoid._core, "track")

TOP = {"body": {"kind": "top", "mass_kg": 0.1, "I_kg_m2": 1e-4, "Is_kg_m2": 1.5e-4, "l_m": 0.03},
       "support": {"kind": "pivot"},
       "model": {"name": "top"},
       "start": {"theta_rad": 0.6, "omega_s_rad_s": 40.0},
       "run": {"until_s": 1.5, "rate_hz": 200.0}}


class Simulate(unittest.TestCase):
    def test_a_spinning_top_keeps_its_energy_and_its_distance_from_the_pivot(self):
        run = trochoid.simulate(TOP)
        self.assertEqual(run.outcome, "reached_end")
        self.assertEqual(run.values.shape, (301, len(run.columns)))
        tolerance = 1e-6  # far above the integration's 1e-10, far below any wrong equation
        energy_J = run["energy_J"]
        np.testing.assert_allclose(energy_J, energy_J[0], rtol=tolerance)
        # The centre of mass is at l sin(theta) beside the pivot's vertical.
        np.testing.assert_allclose(np.hypot(run["x_m"], run["y_m"]), 0.03 * np.sin(run["theta_rad"]),
                                   atol=tolerance * 0.03)

    def test_overrides_win_over_the_scene(self):
        run = trochoid.simulate(TOP, until_s=0.5, rate_hz=50, integrator="dop853")
        self.assertEqual(len(run.values), 26)
        self.assertEqual(run.integrator, "dop853")

    def test_bundled_scenes_have_names_and_a_sentence(self):
        self.assertIn("thesis-base", trochoid.scenes())
        self.assertTrue(all(trochoid.scenes().values()))
        self.assertEqual(trochoid.simulate("thesis-base", until_s=1.0).model, "top")

    def test_a_key_is_a_key_whatever_it_holds(self):
        with self.assertRaisesRegex(trochoid.InputError, "is not a key of .body."):
            trochoid.Scene({"body": {"radius_m = 1\n#": 1}})

    def test_a_scene_survives_the_trip_through_its_text(self):
        for tables in (TOP, {"camera": {"file": "a \"b\"\\\t\r\n\x7f ü.json"}}):
            scene = trochoid.Scene(tables)
            self.assertEqual(trochoid.Scene.from_toml(scene.toml).toml, scene.toml)


class Errors(unittest.TestCase):
    def test_a_wrong_key_names_the_right_one(self):
        with self.assertRaisesRegex(trochoid.InputError, "radius_m"):
            trochoid.Scene({"body": {"radus_m": 0.03}})

    def test_what_is_wrong_with_a_scene_is_told_where_the_caller_can_find_it(self):
        for scene, words in (({"run": {"until_s": 1.0}, "body": {"radius_m": 0.03, "radus_m": 0.03}},
                              r"^scene\['body'\]: 'radus_m' is not a key of \[body\]"),
                             ({"body": {"radius_m": -1.0}}, r"^scene\['body'\]: radius_m = -1 must be"),
                             ({"bdy": {"radius_m": 0.03}}, r"^scene\['bdy'\]: 'bdy' is not a key")):
            with self.subTest(scene), self.assertRaisesRegex(trochoid.InputError, words):
                trochoid.Scene(scene)
        with self.assertRaisesRegex(trochoid.InputError, "^scene text:3: radius_m = -1 must be"):
            trochoid.Scene.from_toml("# a disc\n[body]\nradius_m = -1\n")
        with self.assertRaisesRegex(trochoid.InputError, "^scene: until_s = -1 must be"):
            trochoid.simulate(TOP, until_s=-1.0)

    def test_a_build_without_tracking_says_so(self):
        without = types.SimpleNamespace(**{name: value for name, value in vars(trochoid._core).items()
                                           if name not in ("track", "overlay")})
        with unittest.mock.patch.object(trochoid, "_core", without):
            for name, call in (("track", lambda: trochoid.track("some.mp4")),
                               ("overlay", lambda: trochoid.overlay("some.mp4", noisy_track(), still="x.png"))):
                with self.subTest(name), self.assertRaisesRegex(
                        trochoid.Error, f"^{name}: this trochoid was built without tracking"):
                    call()

    def test_errors_are_also_pythons_own(self):
        self.assertTrue(issubclass(trochoid.InputError, ValueError))
        self.assertTrue(issubclass(trochoid.NumericalError, ArithmeticError))
        with self.assertRaises(ValueError):
            trochoid.simulate(TOP, until_s=-1.0)
        with self.assertRaises(KeyError):
            trochoid.simulate(TOP, until_s=0.1)["no_such_column"]

    def test_arrays_of_the_wrong_shape_are_named(self):
        t_s = np.arange(10.0)
        for wrong in (np.zeros((9, 2)), np.zeros(10), np.zeros((2, 10))):
            with self.assertRaisesRegex(trochoid.InputError, "centre_m"):
                trochoid.fit(trochoid.Track(t_s, wrong), model="top")
        with self.assertRaisesRegex(trochoid.InputError, "does not increase"):
            trochoid.fit(trochoid.Track(t_s[::-1], np.zeros((10, 2))), model="top")
        with self.assertRaisesRegex(trochoid.InputError, "not an array"):
            trochoid.fit(trochoid.Track(t_s, [["a", "b"]] * 10), model="top")
        with self.assertRaisesRegex(trochoid.InputError, "frame"):
            trochoid.fit(trochoid.Track(t_s, np.zeros((10, 2)), frame=np.full(10, np.nan)),
                         model="top")
        with self.assertRaises(trochoid.InputError):
            trochoid.fit(17, model="top")
        skew = np.tile([[1.0, 0.5], [0.4, 1.0]], (10, 1, 1))
        with self.assertRaisesRegex(trochoid.InputError, r"covariance_m2\[0\] is not symmetric"):
            trochoid.fit(trochoid.Track(t_s, np.zeros((10, 2)), skew), model="top")

    def test_a_wrong_kind_of_value_is_named_in_one_line(self):
        track, fit = noisy_track(), trochoid.fit
        wrong = [lambda: fit(track, TOP, model=None), lambda: fit(track, TOP, compare="yes"),
                 lambda: fit(track, TOP, bootstrap=1.5), lambda: fit(track, TOP, bootstrap=10**9), lambda: fit(track, TOP, threads=-1),
                 lambda: fit(track, TOP, seed=None), lambda: fit(track, TOP, start={"l_m": "long"}),
                 lambda: fit(track, TOP, from_=[1.0]), lambda: fit(track, TOP, output=3),
                 lambda: fit(trochoid.Track(track.t_s, track.centre_m, object=None), TOP),
                 lambda: fit(trochoid.Track(track.t_s, track.centre_m * 1j), TOP),
                 lambda: trochoid.TrackFile([track], source=None).write("never.csv"),
                 lambda: trochoid.read_track(None), lambda: trochoid.predict(None, track),
                 lambda: trochoid.simulate(TOP, model=None), lambda: trochoid.simulate(TOP, until_s="1")]
        for number, call in enumerate(wrong):
            with self.subTest(number), self.assertRaises(trochoid.InputError) as raised:
                call()
            self.assertNotIn("\n", str(raised.exception))

    def test_an_unknown_name_in_a_first_guess_is_told_with_those_there_are(self):
        for compare, whose in ((False, "model 'top' has .*l_m"), (True, "the models compared have .*l_m")):
            with self.subTest(compare), self.assertRaisesRegex(
                    trochoid.InputError, "start: no parameter is called 'lm'; " + whose):
                trochoid.fit(noisy_track(), TOP, compare=compare, start={"lm": 0.1})

    def test_a_first_guess_is_a_number(self):
        with self.assertRaisesRegex(trochoid.InputError, "l_m = nan must be a finite number"):
            trochoid.fit(noisy_track(), TOP, start={"l_m": float("nan")})

    def test_a_scene_takes_no_attributes(self):
        with self.assertRaises(AttributeError):
            trochoid.Scene(TOP).fit = {"free": []}

    def test_what_is_wrong_with_a_moment_is_told_without_options_of_the_program(self):
        track = noisy_track()
        for moments in ({"from_": 0.5, "to": 0.1}, {"from_": "soon"}, {"to": "f1.5"}, {"from_": 1e6}):
            with self.subTest(moments), self.assertRaisesRegex(trochoid.InputError, "from|to") as raised:
                trochoid.fit(track, TOP, **moments)
            self.assertNotIn("--", str(raised.exception))
        with self.assertRaisesRegex(trochoid.InputError, r"\[tracking\] from = 2 lies after to = 1"):
            trochoid.Scene({"tracking": {"from": 2, "to": 1}})

    def test_everything_public_is_documented(self):
        for name in trochoid.__all__:
            self.assertTrue(inspect.getdoc(getattr(trochoid, name)), name)


def noisy_track(sigma_m=1e-4, seed=1):
    run = trochoid.simulate(TOP)
    noise = np.random.default_rng(seed).normal(0.0, sigma_m, (len(run.values), 2))
    return trochoid.Track(run["t_s"], np.column_stack([run["x_m"], run["y_m"]]) + noise,
                          covariance_m2=np.tile(sigma_m**2 * np.eye(2), (len(noise), 1, 1)))


class Fit(unittest.TestCase):
    def test_planted_parameters_come_back_within_their_errors(self):
        fit = trochoid.fit(noisy_track(), model="top")
        self.assertTrue(fit.converged, fit.reason)
        l = fit["l_m"]
        self.assertLess(abs(l.value - 0.03), 4.0 * l.sigma)  # 4 sigma: once in 16,000 seeds
        self.assertEqual(fit.covariance.shape, 2 * (len(fit.covariance_names),))

    def test_every_key_of_the_file_is_an_attribute(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "fit.json"
            fit = trochoid.fit(noisy_track(), model="top", profile=True, bootstrap=8, output=path)
            keys = json.loads(path.read_text())
        version = keys.pop("trochoid_fit")
        self.assertEqual(version, 1)
        for key, value in keys.items():
            self.assertTrue(hasattr(fit, key), key)
            if isinstance(value, (str, bool, int, float)):
                self.assertEqual(getattr(fit, key), value, key)
        for name in ("profiles", "null_vectors", "comparison", "arcs"):
            of_file = [one.keys() for one in keys[name]]
            self.assertEqual(len(getattr(fit, name)), len(of_file), name)
            for one, its_keys in zip(getattr(fit, name), of_file):
                self.assertLessEqual(set(its_keys), set(dir(one)), name)
        self.assertEqual([p.parameter for p in fit.profiles], [p["parameter"] for p in keys["profiles"]])
        np.testing.assert_array_equal(fit.profiles[0].delta_chi2, keys["profiles"][0]["delta_chi2"])
        self.assertEqual(fit.bootstrap.draws, 8)
        self.assertEqual([b.sigma for b in fit.bootstrap.parameters],
                         [b["sigma"] for b in keys["bootstrap"]["parameters"]])

    def test_what_a_fit_is_worth_is_seen_where_it_is_printed(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "fit.json"
            trochoid.fit(noisy_track(), model="top", output=path)
            keys = json.loads(path.read_text())
            for verdict, shown in (("good", "good"), ("weak", "weak"), ("", "converged")):
                path.write_text(json.dumps({**keys, "verdict": verdict}))
                with self.subTest(verdict):
                    self.assertIn(f"<Fit of top: {shown}, ", repr(trochoid.read_fit(path)))

    def test_a_parameter_that_is_not_there_is_told_with_those_there_are(self):
        with self.assertRaisesRegex(KeyError, "nope; there are .*l_m"):
            trochoid.fit(noisy_track(), model="top")["nope"]

    def test_the_answer_does_not_depend_on_threads_and_survives_its_file(self):
        track = noisy_track()
        with tempfile.TemporaryDirectory() as folder:
            one, many, again = (os.path.join(folder, name) for name in ("1", "4", "again"))
            trochoid.fit(track, model="top", bootstrap=8, threads=1, output=one)
            trochoid.fit(track, model="top", bootstrap=8, threads=4, output=many)
            trochoid.read_fit(one).write(again)
            texts = [pathlib.Path(path).read_bytes() for path in (one, many, again)]
        self.assertEqual(texts[0], texts[1])
        self.assertEqual(texts[0], texts[2])

    def test_a_fit_and_a_scene_go_to_another_process_and_back_unchanged(self):
        fit = trochoid.fit(noisy_track(), model="top")
        again = pickle.loads(pickle.dumps(fit))
        self.assertEqual(again, fit)
        self.assertEqual(again["l_m"].value, fit["l_m"].value)
        self.assertNotEqual(again, trochoid.fit(noisy_track(seed=2), model="top"))
        self.assertEqual(pickle.loads(pickle.dumps(trochoid.Scene(TOP))), trochoid.Scene(TOP))

    def test_a_fit_is_asked_for_its_parameters_like_a_dict_and_not_changed(self):
        fit = trochoid.fit(noisy_track(), model="top")
        self.assertIn("l_m", fit)
        self.assertNotIn("nope", fit)
        self.assertEqual(list(fit), list(fit.parameters))
        self.assertEqual(dict(fit).keys(), fit.parameters.keys())
        self.assertEqual([p.value for _, p in fit.items()], [p.value for p in fit.values()])
        with self.assertRaisesRegex(AttributeError, "cannot be changed"):
            fit.model = "rolling"
        with self.assertRaisesRegex(AttributeError, "a Fit has no attribute 'chi'"):
            fit.chi

    def test_a_fit_is_one_object_to_numpy_like_a_dict(self):
        fit = trochoid.fit(noisy_track(), model="top")
        self.assertEqual(np.array(fit).shape, ())
        self.assertIs(np.array([fit, fit], dtype=object)[1], fit)
        with self.assertRaises((TypeError, ValueError)):
            np.array(fit, dtype=float)

    def test_a_simulated_motion_is_fitted_as_a_track_of_it(self):
        run = trochoid.simulate(TOP)
        of_run = trochoid.fit(run, model="top")
        of_track = trochoid.fit(trochoid.Track(run["t_s"], np.column_stack([run["x_m"], run["y_m"]])),
                                model="top")
        self.assertEqual(of_run["l_m"].value, of_track["l_m"].value)
        exact = trochoid.fit(trochoid.simulate("thesis-base", until_s=20), model="top")
        self.assertIn(exact.verdict, ("good", "good_correlated"), exact.verdict_words)
        self.assertLess(len(repr(run)), 100)

    def test_the_motion_a_fit_found_is_simulated_beyond_its_track(self):
        longer = trochoid.simulate(trochoid.fit(noisy_track(), model="top"), until_s=2.0, rate_hz=200)
        truth = trochoid.simulate(TOP, until_s=2.0)
        # 301 positions of 1e-4 m leave a sixth of that, and half a second more triples it.
        np.testing.assert_allclose(longer["x_m"], truth["x_m"], atol=1e-4)

    def test_a_fit_is_not_replayed_over_the_file_of_another_track(self):
        with tempfile.TemporaryDirectory() as folder:
            own, other = os.path.join(folder, "own.csv"), os.path.join(folder, "other.csv")
            trochoid.TrackFile([noisy_track()]).write(own)
            trochoid.TrackFile([noisy_track(seed=2)]).write(other)
            fit = trochoid.fit(own, model="top")
            self.assertEqual(len(trochoid.predict(fit, own)), 1)
            with self.assertRaisesRegex(trochoid.InputError, "was not fitted to .*other.csv"):
                trochoid.predict(fit, other)

    def test_a_fit_tells_the_checksums_of_its_scene_and_camera(self):
        seen_by = {"camera": {"file": str(SAMPLE / "camera.json")}, "model": {"name": "top"}}
        self.assertEqual(set(trochoid.fit(noisy_track(), seen_by).inputs), {"camera.json"})
        with tempfile.TemporaryDirectory() as folder:
            scene = pathlib.Path(folder) / "scene.toml"
            scene.write_text(trochoid.Scene(seen_by).toml)
            self.assertEqual(set(trochoid.fit(noisy_track(), scene).inputs),
                             {"scene.toml", "camera.json"})

    def test_tracks_of_one_name_are_kept_apart_and_none_counts_twice(self):
        with tempfile.TemporaryDirectory() as folder:
            paths = [pathlib.Path(folder) / name / "top.track.csv" for name in ("a", "b")]
            for number, path in enumerate(paths):
                path.parent.mkdir()
                trochoid.TrackFile([noisy_track(seed=number)], source="top.mp4",
                                   source_sha256=64 * str(number)).write(path)
            fit = trochoid.fit(paths, model="top")
            self.assertEqual(set(fit.inputs), {"top.track.csv", str(paths[1]), "top.mp4",
                                               f"source of {paths[1]}"})
            for number, path in enumerate(paths):
                self.assertEqual(len(trochoid.predict(fit, path, fit_track=number)), 1)
            with self.assertRaisesRegex(trochoid.InputError, "is the same track as top.track.csv"):
                trochoid.fit([paths[0], paths[0]], model="top")
        track = noisy_track()
        with self.assertRaisesRegex(trochoid.InputError, "is given twice"):
            trochoid.fit([track, trochoid.TrackFile([track])], model="top")

    def test_a_name_that_is_no_utf_8_is_shown_as_far_as_it_can_be(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, os.fsdecode(b"r\xe9.csv"))
            with open(path, "wb") as file:
                file.write(b"# source: r\xe9.mp4\nt_s,x_m,y_m\n")
                track = noisy_track()
                np.savetxt(file, np.column_stack([track.t_s, track.centre_m]), delimiter=",")
            self.assertEqual(trochoid.read_track(path).source, "r\ufffd.mp4")
            self.assertEqual(set(trochoid.fit(path, model="top").inputs), {"r\ufffd.csv"})
            for load in (trochoid.read_track, trochoid.Scene):
                with self.assertRaisesRegex(trochoid.InputError, "no\ufffd.csv: "):
                    load(os.path.join(folder, os.fsdecode(b"no\xe9.csv")))

    def test_samples_without_a_position_are_gaps_and_counted(self):
        track, seen = noisy_track(), noisy_track()
        track.centre_m[:3] = track.centre_m[100:110] = np.nan
        kept = np.isfinite(track.centre_m[:, 0])
        for name in ("t_s", "centre_m", "covariance_m2"):
            setattr(seen, name, getattr(seen, name)[kept])
        fit, of_seen = trochoid.fit(track, model="top"), trochoid.fit(seen, model="top")
        self.assertEqual(fit.time_origin_s, seen.t_s[0])
        self.assertEqual(fit["l_m"].value, of_seen["l_m"].value)
        self.assertEqual(fit.arcs[0].samples, int(kept.sum()))
        self.assertIn("13 of 301 samples give no position and are left out: gaps", fit.warnings)
        masked = noisy_track()
        masked.centre_m = np.ma.masked_array(masked.centre_m, mask=np.isnan(track.centre_m))
        self.assertEqual(trochoid.fit(masked, model="top")["l_m"].value, fit["l_m"].value)
        self.assertEqual(masked, track)
        self.assertNotEqual(masked, noisy_track())
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "nan.csv"
            np.savetxt(path, np.column_stack([track.t_s, track.centre_m]), delimiter=",",
                       header="t_s,x_m,y_m", comments="")
            self.assertEqual(trochoid.read_track(path).notes,
                             ["13 of 301 rows give no position and are left out: gaps"])

    def test_a_fit_is_replayed_close_to_its_track(self):
        track = noisy_track()
        arc, = trochoid.predict(trochoid.fit(track, model="top"), track)
        at = np.searchsorted(arc.t_s, track.t_s)
        residuals = arc.centre_m[at, :2] - track.centre_m
        # The noise is 1e-4; the mean over 602 numbers scatters by 3 %.
        self.assertLess(np.sqrt(np.mean(residuals**2)), 1.1e-4)

    def test_tracks_are_equal_where_all_they_hold_is_the_unknown_included(self):
        track, same = noisy_track(), noisy_track()
        track.theta_rad, same.theta_rad = (np.full(len(track), np.nan) for _ in range(2))
        self.assertEqual(track, same)
        self.assertEqual(trochoid.TrackFile([track]), trochoid.TrackFile([same]))
        same.centre_m[7, 1] += 1e-9
        self.assertNotEqual(track, same)
        self.assertNotEqual(trochoid.TrackFile([track]), trochoid.TrackFile([same]))
        self.assertNotEqual(track, trochoid.Track(track.t_s))

    def test_a_track_survives_its_file(self):
        track = noisy_track()
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "Spur – größer.csv")
            trochoid.TrackFile([track]).write(path)
            back, = trochoid.read_track(path).tracks
        np.testing.assert_array_equal(back.t_s, track.t_s)
        np.testing.assert_array_equal(back.centre_m, track.centre_m)
        self.assertTrue(np.isnan(back.theta_rad).all())
        self.assertEqual(back, trochoid.Track(track.t_s, track.centre_m, track.covariance_m2,
                                              quality=back.quality))


class Threads(unittest.TestCase):
    def test_other_threads_run_during_a_fit(self):
        beats, stop = [], threading.Event()

        def beat():
            while not stop.wait(0.002):
                beats.append(time.monotonic())

        thread = threading.Thread(target=beat)
        thread.start()
        start = time.monotonic()
        trochoid.fit(noisy_track(), model="top", bootstrap=200)
        lasted_s = time.monotonic() - start
        stop.set()
        thread.join()
        self.assertGreater(len(beats), 0.05 * lasted_s / 0.002)

    def test_control_c_ends_a_long_fit(self):
        timer = threading.Timer(0.3, _thread.interrupt_main)
        timer.start()
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            trochoid.fit(noisy_track(), model="top", bootstrap=100000)
        self.assertLess(time.monotonic() - start, 20.0)


@unittest.skipUnless(HAS_TRACKING, "built without tracking")
class Recording(unittest.TestCase):
    def test_a_recording_is_tracked_and_drawn(self):
        with tempfile.TemporaryDirectory() as folder:
            output, still, table = (pathlib.Path(folder) / name for name in
                                    ("overlay.mp4", "path.png", "s1.track.csv"))
            file = trochoid.track(SAMPLE / "video.mp4", SAMPLE / "scene.toml", to="f40", output=table)
            track, = file.tracks
            self.assertEqual(len(track), file.summary["found"])
            np.testing.assert_array_equal(trochoid.read_track(table).tracks[0].t_s, track.t_s)
            truth = np.genfromtxt(SAMPLE / "truth.csv", delimiter=",", names=True)
            rows = truth[np.searchsorted(truth["frame"], track.frame)]
            pixels = np.column_stack([rows["x_px"], rows["y_px"]])
            rms_px = np.sqrt(np.mean((track.centre_px - pixels) ** 2))
            self.assertLess(rms_px, 0.3)  # several times what this clean recording needs
            frames = trochoid.overlay(SAMPLE / "video.mp4", file, output=output, still=still,
                                      scene=SAMPLE / "scene.toml", to="f10")
            self.assertEqual(len(frames.frame), 11)
            self.assertGreater(output.stat().st_size, 1000)
            self.assertGreater(still.stat().st_size, 1000)

    def test_a_quick_look_is_written_smoothed_as_well(self):
        with tempfile.TemporaryDirectory() as folder:
            smooth = pathlib.Path(folder) / "smooth.csv"
            file = trochoid.track(SAMPLE / "video.mp4", SAMPLE / "scene.toml", to="f40",
                                  effort="quick", smooth=smooth)
            header = [line for line in smooth.read_text().splitlines() if not line.startswith("#")][0]
            self.assertIn("vx_m_s", header.split(","))
            self.assertEqual((file.summary["interpolated"], file.summary["left_out"]), (0, 0))
            before = (SAMPLE / "video.mp4").read_bytes()
            with self.assertRaises(trochoid.InputError):
                trochoid.track(SAMPLE / "video.mp4", to="f5", smooth=SAMPLE / "video.mp4")
            self.assertEqual((SAMPLE / "video.mp4").read_bytes(), before)
            copy = pathlib.Path(folder) / "copy.mp4"
            copy.write_bytes(before)
            with self.assertRaisesRegex(trochoid.InputError, "name another output"):
                trochoid.overlay(copy, file, scene=SAMPLE / "scene.toml", output=copy)
            self.assertEqual(copy.read_bytes(), before)
            still = pathlib.Path(folder) / "still.png"
            with self.assertRaisesRegex(trochoid.InputError, "name it .mp4"):
                trochoid.overlay(copy, file, output=pathlib.Path(folder) / "overlay.avi", still=still)
            self.assertFalse(still.exists())
            file.source_sha256 = 64 * "0"
            with self.assertRaisesRegex(trochoid.InputError, "track: was tracked in another recording"):
                trochoid.overlay(copy, file, still=pathlib.Path(folder) / "other.png")
            other = pathlib.Path(folder) / "other.track.csv"
            file.write(other)
            with self.assertRaisesRegex(trochoid.InputError,
                                        "other.track.csv: was tracked in another recording"):
                trochoid.overlay(copy, other, still=pathlib.Path(folder) / "other.png")
        for wrong in ({"effort": None}, {"objects": 1.5}, {"at_px": 3}, {"rate_hz": "fast"}):
            with self.assertRaisesRegex(trochoid.InputError, next(iter(wrong))):
                trochoid.track(SAMPLE / "video.mp4", **wrong)
        for outside in ({"objects": 65}, {"rate_hz": -1.0}, {"from_": -1}):  # as the program's options
            (name, value), = outside.items()
            with self.assertRaisesRegex(trochoid.InputError, f"^{name.strip('_')} = {value:g} "):
                trochoid.track(SAMPLE / "video.mp4", **outside)
        with self.assertRaisesRegex(trochoid.InputError, "quick, normal or exact"):
            trochoid.track(SAMPLE / "video.mp4", effort="hasty")

    def test_a_signal_handler_s_own_exception_comes_through(self):
        class Enough(Exception):
            pass

        def enough(*_):
            raise Enough

        before = signal.signal(signal.SIGALRM, enough)
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.2)
            with self.assertRaises(Enough):
                trochoid.track(SAMPLE / "video.mp4")
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)

    def test_control_c_ends_tracking_at_once_wherever_it_is(self):
        def track(folder):
            trochoid.track(SAMPLE / "video.mp4", SAMPLE / "scene.toml", effort="exact",
                           edges=os.path.join(folder, "edges.csv"),
                           output=os.path.join(folder, "track.csv"))

        with tempfile.TemporaryDirectory() as folder:
            begun = time.monotonic()
            track(folder)
            lasts_s = time.monotonic() - begun
        for share in (0.1, 0.3, 0.6):  # reading, in the first look, going over it again
            pressed = []

            def press():
                pressed.append(time.monotonic())
                _thread.interrupt_main()

            threading.Timer(share * lasts_s, press).start()
            with self.subTest(share), tempfile.TemporaryDirectory() as folder:
                with self.assertRaises(KeyboardInterrupt):
                    track(folder)
                self.assertLess(time.monotonic() - pressed[0], 1.0)  # 0.1 s where nothing else runs
                self.assertEqual(os.listdir(folder), [])

    def test_control_c_ends_what_an_executor_s_threads_have_begun(self):
        handler = signal.getsignal(signal.SIGINT)
        with concurrent.futures.ThreadPoolExecutor(2) as pool:
            futures = [pool.submit(trochoid.track, SAMPLE / "video.mp4", SAMPLE / "scene.toml",
                                   effort="exact") for _ in range(2)]
            with self.assertRaises(KeyboardInterrupt):
                threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
                futures[0].result()
            pressed = time.monotonic()
            for future in futures:
                self.assertIsInstance(future.exception(), KeyboardInterrupt)
            self.assertLess(time.monotonic() - pressed, 1.0)
        self.assertIs(signal.getsignal(signal.SIGINT), handler)
        with self.assertRaises(KeyboardInterrupt):  # as before
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1.0)

    def test_what_is_no_recording_is_an_input_error(self):
        with self.assertRaisesRegex(trochoid.InputError, "no_such.mp4"):
            trochoid.track("no_such.mp4")


if __name__ == "__main__":
    unittest.main()
