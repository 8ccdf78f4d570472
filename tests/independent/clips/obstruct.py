#!/usr/bin/python3
"""Variants of recordings with truth in which something is in the way, or the camera moves.

    obstruct.py OUT FOLDER... [--variants NAME,...]

writes OUT/<folder name>_<variant> for each, in the layout that `trochoid study tracking OUT/*` reads: arms and bars over the
body, other things on the floor, lamps that flicker, the body leaving the picture or resting, noise, compression. The
picture's own light stays what the recording had. A stand sags (by 3 px in all), shakes (1 px, 17 and 23 Hz), is knocked (by
1.5 px, or far: 20 px) or turns (by 1 degree): truth.csv's metres and angles stay, its pixels go along. It says which share of the outline is left to see. At most 200
frames of each are used. Needs numpy, scipy, ffmpeg.
"""
import argparse, csv, json, subprocess
from pathlib import Path

import numpy as np
from scipy.ndimage import affine_transform, gaussian_filter

FRAMES, GAMMA = 200, 2.2


class Clip:
    """Frames, camera and truth of a folder; the outline of the body in pixels, by frame."""

    def __init__(self, folder):
        self.camera, self.body = (json.loads((folder / f).read_text()) for f in ("camera.json", "object.json"))
        size = self.camera["height"], self.camera["width"], 3
        raw = subprocess.run(["ffmpeg", "-v", "error", "-i", folder / "video.mp4", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
                             stdout=subprocess.PIPE, check=True).stdout
        self.frames = np.frombuffer(raw, np.uint8).reshape(-1, *size)[:FRAMES].astype(float)
        self.truth = list(csv.DictReader((folder / "truth.csv").open()))[:len(self.frames)]
        self.outlines = [self.outline(row) for row in self.truth]
        self.centres = np.array([[float(row["x_px"]), float(row["y_px"])] for row in self.truth])
        self.size_px = np.ptp(self.outlines[0], axis=0).max()
        self.y, self.x = np.mgrid[:size[0], :size[1]]

    def outline(self, row, n=60):
        radius = self.body.get("R_m") or self.body["R_outer_m"]
        half = (self.body.get("thickness_m") or self.body["height_m"]) / 2
        w, x, y, z = (float(row[k]) for k in ("qw", "qx", "qy", "qz"))
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                         [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                         [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        a = np.linspace(0, 2 * np.pi, n, endpoint=False)
        rims = np.vstack([np.stack([radius * np.cos(a), radius * np.sin(a), 0 * a + h], 1) for h in (half, -half)])
        at = rims @ turn.T + [float(row[k]) for k in ("x_m", "y_m", "z_m")]
        p = at @ np.array(self.camera["R_world_to_cam"]).T + np.array(self.camera["t_world_to_cam_m"])
        uv, (k1, k2) = p[:, :2] / p[:, 2:], self.camera["dist_k1_k2_p1_p2_k3"][:2]
        r2 = (uv**2).sum(1, keepdims=True)
        return uv * (1 + r2 * (k1 + r2 * k2)) * [self.camera["fx"], self.camera["fy"]] + [self.camera["cx"], self.camera["cy"]]


def lit(frame, share):
    """The frame in so much of its light."""
    return 255 * np.clip((frame / 255) ** GAMMA * share, 0, 1) ** (1 / GAMMA)


def covered(frame, mask, colour):
    cover = gaussian_filter(mask.astype(float), 0.6)[..., None]
    light = (frame / 255) ** GAMMA * (1 - cover) + (np.array(colour) / 255.0) ** GAMMA * cover
    return 255 * light ** (1 / GAMMA)


def arm(clip, i):
    """From the left over the body in the middle frame, bent a little on its way; withdraws slowly."""
    middle = len(clip.frames) // 2
    s, target, half = (i - middle) / (0.14 * len(clip.frames)), clip.centres[middle], 0.28 * clip.size_px
    if abs(s) > 1.6:
        return np.zeros(clip.x.shape, bool)
    tip, y = target[0] - 20 + 1.1 * clip.size_px * (1 - abs(s)), target[1] + 0.25 * clip.size_px * np.sin(3 * s)
    along = (clip.x < tip) & (abs(clip.y - y - 0.15 * (clip.x - tip)) < half)
    return along | ((clip.x - tip) ** 2 + (clip.y - y) ** 2 < half**2)


def bar(clip, _):
    x, y = np.median(clip.centres, axis=0)
    return abs((clip.x - x) * 0.94 + (clip.y - y) * 0.34) < 0.11 * clip.size_px


def coin(clip, _):
    """At rest where the body stays farthest from."""
    margin, (h, w) = 0.6 * clip.size_px, clip.x.shape
    places = [(x, y) for x in np.arange(margin, w - margin, 20) for y in np.arange(margin, h - margin, 20)]
    x, y = max(places, key=lambda p: np.linalg.norm(clip.centres - p, axis=1).min())
    return (clip.x - x) ** 2 + (clip.y - y) ** 2 < (0.42 * clip.size_px) ** 2


def in_the_way(mask_of, colour):
    def variant(clip, random):
        masks = [mask_of(clip, i) for i in range(len(clip.frames))]
        for row, mask, outline in zip(clip.truth, masks, clip.outlines):
            o = np.rint(outline).astype(int).clip(0, [mask.shape[1] - 1, mask.shape[0] - 1])
            row["vis_frac"] = 1 - mask[o[:, 1], o[:, 0]].mean()
        return [covered(f, m, colour) + random.normal(0, 0.5, f.shape) if m.any() else f for f, m in zip(clip.frames, masks)]
    return variant


def light(share_of):
    """@param share_of (frame's number over their count, its number, height in the picture) -> share"""
    def variant(clip, _):
        count, rows = len(clip.frames), (clip.y / clip.y.max())[..., None]
        return [lit(f, share_of(i / count, i, rows)) for i, f in enumerate(clip.frames)]
    return variant


def leaves(clip, _):
    """Cut where the body spends a third of its time beyond."""
    left = int(np.percentile(clip.centres[:, 0], 30))
    for row, outline in zip(clip.truth, clip.outlines):
        row["x_px"], row["vis_frac"] = float(row["x_px"]) - left, (outline[:, 0] > left).mean()
    clip.camera["cx"] -= left
    width = (clip.x.shape[1] - left) // 2 * 2
    return [f[:, left:left + width] for f in clip.frames]


def rests(clip, random):
    before, after = [dict(clip.truth[0]) for _ in range(80)], [dict(clip.truth[-1]) for _ in range(60)]
    still = lambda f, n: [f + random.normal(0, 1, f.shape) for _ in range(n)]
    frames = still(clip.frames[0], 80) + list(clip.frames) + still(clip.frames[-1], 60)
    clip.truth = before + clip.truth + after
    for i, row in enumerate(clip.truth):
        row["frame"], row["t"] = i, i / clip.camera["fps"]
    return frames


def camera_moves(path_of, turned_of=np.zeros_like):
    """@param path_of (times in s) -> where the picture has gone, n x 2 [px]
    @param turned_of (times in s) -> by how much it has turned about its middle, right on the screen [rad]"""
    def variant(clip, random):
        t = np.arange(len(clip.frames)) / clip.camera["fps"]
        middle = 0.5 * (np.array(clip.x.shape[::-1]) - 1)
        ways = list(zip(path_of(t), turned_of(t)))
        for row, (gone, by) in zip(clip.truth, ways):
            turn = np.array([[np.cos(by), -np.sin(by)], [np.sin(by), np.cos(by)]])
            at = np.array([float(row["x_px"]), float(row["y_px"])])
            row["x_px"], row["y_px"] = middle + turn @ (at - middle) + gone

        def moved(frame, gone, by):
            back = np.array([[np.cos(by), -np.sin(by)], [np.sin(by), np.cos(by)]])  # of (y, x)
            start = middle[::-1] - back @ (middle + gone)[::-1]
            return np.stack([affine_transform(frame[..., c], back, start, order=3, mode="nearest") for c in range(3)], axis=2)
        return [moved(f, *way) + random.normal(0, 0.4, f.shape) for f, way in zip(clip.frames, ways)]
    return variant


def shakes(t):
    return np.stack([np.sin(2 * np.pi * 17.3 * t), np.sin(2 * np.pi * 23.1 * t + 1)], axis=1)


def noisy(sd, contrast=1.0, floor=0.0):
    def variant(clip, random):
        dim = lambda f: 255 * (contrast * (f / 255) ** GAMMA + floor) ** (1 / GAMMA)
        return [dim(f) + random.normal(0, sd, f.shape) for f in clip.frames]
    return variant


H264 = ["-c:v", "libx264", "-crf", "14", "-pix_fmt", "yuv420p"]
VARIANTS = {
    "hand": (in_the_way(arm, (196, 150, 128)), H264), "sleeve": (in_the_way(arm, (45, 48, 60)), H264),
    "bar": (in_the_way(bar, (70, 90, 60)), H264), "coin": (in_the_way(coin, (150, 120, 60)), H264),
    "flicker": (light(lambda t, i, _: 0.8 * (1 + 0.12 * np.sin(2 * np.pi * 0.37 * i) + 0.15 * t)), H264),
    "bands": (light(lambda _, i, y: 0.85 * (1 + 0.1 * np.sin(2 * np.pi * (1.5 * y + 0.23 * i)))), H264),
    "steps": (light(lambda t, *_: 1.0 if t < 1 / 3 else 0.7 if t < 2 / 3 else 0.85), H264),
    "leaves": (leaves, H264), "rests": (rests, H264), "noise": (noisy(9.0), H264), "dim": (noisy(4.0, 0.25, 0.12), H264),
    "sags": (camera_moves(lambda t: 3 * np.outer(t / t[-1], [0.8, 0.6])), H264), "shakes": (camera_moves(shakes), H264),
    "knocked": (camera_moves(lambda t: 1.5 * np.outer(t > 0.6 * t[-1], [0.8, -0.6])), H264),
    "far": (camera_moves(lambda t: 20 * np.outer(t > 0.6 * t[-1], [0.8, -0.6])), H264),
    "turns": (camera_moves(lambda t: 0 * np.outer(t, [1, 1]), lambda t: np.radians(1) * t / t[-1]), H264),
    "strong": (noisy(0.0), ["-c:v", "libx264", "-crf", "27", "-pix_fmt", "yuv420p"]),
    "hevc10": (noisy(0.0), ["-c:v", "libx265", "-x265-params", "log-level=none", "-crf", "14", "-pix_fmt", "yuv420p10le"]),
}


def write(folder, clip, frames, encoding):
    folder.mkdir(parents=True, exist_ok=True)
    h, w = frames[0].shape[:2]
    command = ["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{w}x{h}", "-r",
               f"{clip.camera['fps']:g}", "-i", "-", *encoding, folder / "video.mp4"]
    file = subprocess.Popen(command, stdin=subprocess.PIPE)
    for frame in frames:
        file.stdin.write(np.clip(np.rint(frame), 0, 255).astype(np.uint8).tobytes())
    file.stdin.close()
    if file.wait():
        raise SystemExit(f"{folder}: ffmpeg failed")
    clip.camera |= {"width": w, "height": h}
    (folder / "camera.json").write_text(json.dumps(clip.camera, indent=1))
    (folder / "object.json").write_text(json.dumps(clip.body, indent=1))
    with (folder / "truth.csv").open("w", newline="") as out:
        table = csv.DictWriter(out, clip.truth[0].keys(), lineterminator="\n")
        table.writeheader()
        table.writerows(clip.truth)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--variants", default=",".join(VARIANTS))
    options = parser.parse_args()
    for folder in options.folders:
        for name in options.variants.split(","):
            if name not in VARIANTS:
                raise SystemExit(f"--variants: {name} is none of {', '.join(VARIANTS)}")
            clip, (variant, encoding) = Clip(folder), VARIANTS[name]
            write(options.out / f"{folder.name}_{name}", clip, variant(clip, np.random.default_rng(5)), encoding)


main()
