#!/usr/bin/env python3
"""Whole runs give the same bytes on another CPU as on this machine: tracks.csv, telemetry.bin, and of summary.json all but
times and memory.

    same_bytes.py --native STEREOTRACK --other STEREOTRACK NAME EMULATOR [ARGUMENT...]
    same_bytes.py names                                                                    which NAMEs there are

An emulator draws a scene for long: it draws a few small pairs itself; of the rest this machine draws the pictures.
Recordings are those of ../shared/data that are pictures; without them exit 77. A video is not compared: FFmpeg's decoder gives
other pixels on ARM (XVID: up to 3 grey levels), before any code of ours sees them.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

DATA = pathlib.Path(__file__).resolve().parents[3] / "shared/data"
SKIPPED = 77
# Of summary.json: what two machines may differ in.
OF_THE_MACHINE = ["stages_ms", "memory_bytes"]  # pointers have 32 bits or 64
# NAME: (source, options, whether tracks must come of it)
SCENES = {
    "drawn_robust": ("synthetic:eleven", ["--set", "preset=robust", "--frames", "1:3", "--set", "synthetic.width=160",
                                          "--set", "synthetic.height=120"], False),
    "drawn_thesis": ("synthetic:eleven", ["--set", "preset=thesis", "--frames", "1:3", "--set", "synthetic.width=160",
                                          "--set", "synthetic.height=120"], False),
    "eleven_robust": ("SCENE", ["--set", "preset=robust"], True),
    "eleven_thesis": ("SCENE", ["--set", "preset=thesis"], True),
    "eleven_scalar": ("SCENE", ["--simd", "scalar", "--frames", "1:40"], True),
    "eleven_dense": ("SCENE", ["--set", "disparity.mode=dense", "--frames", "1:20"], False),
}
RECORDINGS = {
    "conveyor": ("dtu_conveyor_stereo", ["--calibration", "dtu_conveyor_stereo/derived_stereo_calibration.yml",
                                         "--frames", "96:112"], True),
    "pitch": ("baseball_stereo_slow126/one_pitch", ["--calibration", "baseball_stereo_slow126/calibration.yml",
                                                    "--frames", "1:12"], True),
    "highway": ("mono:cdnet_highway/input", ["--frames", "1:40"], False),
    "kitti": ("kitti_odom_sample/sequences/03", ["--frames", "1:4"], False),
    "euroc": ("euroc_micro/mav0", [], False),
}


def replay(command, source, options, out):
    done = subprocess.run([*command, "replay", source, "--out", str(out), *options], cwd=DATA if DATA.is_dir() else None,
                          capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)} replay {source} {' '.join(options)}: exit {done.returncode}\n{done.stderr}")


def summary_of(folder):
    summary = json.loads((folder / "summary.json").read_text())
    for key in OF_THE_MACHINE:
        del summary[key]
    return json.dumps(summary, indent=1).splitlines()


def first_difference(mine, other):
    for number, (a, b) in enumerate(zip(mine, other), 1):
        if a != b:
            return f"line {number}: {a} here, {b} there"
    return f"{len(mine)} lines here, {len(other)} there"


def compare(name, native, other, case, scene):
    source, options, must_track = case
    source = source.replace("SCENE", str(scene))
    with tempfile.TemporaryDirectory() as temporary:
        here, there = pathlib.Path(temporary) / "here", pathlib.Path(temporary) / "there"
        replay([native], source, options, here)
        begun = time.monotonic()
        replay(other, source, options, there)
        took = time.monotonic() - begun
        tracks, others = ((folder / "tracks.csv").read_text().splitlines() for folder in (here, there))
        telemetry = (here / "telemetry.bin").read_bytes()
        if must_track and not tracks:
            sys.exit(f"{name}: no tracks, so that little is compared")
        if not telemetry:
            sys.exit(f"{name}: no telemetry to compare")
        if tracks != others:
            sys.exit(f"{name}: tracks.csv differs: {first_difference(tracks, others)}")
        if telemetry != (there / "telemetry.bin").read_bytes():
            sys.exit(f"{name}: telemetry.bin differs; tracks.csv does not")
        mine, theirs = summary_of(here), summary_of(there)
        if mine != theirs:
            sys.exit(f"{name}: summary.json differs: {first_difference(mine, theirs)}")
        print(f"{name}: the same {len(tracks)} rows of tracks and {len(telemetry)} bytes of telemetry; emulated in "
              f"{took:.0f} s", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=["names", *SCENES, *RECORDINGS])
    parser.add_argument("--native")
    parser.add_argument("--other")
    parser.add_argument("emulator", nargs=argparse.REMAINDER)
    args = parser.parse_args()
    if args.name == "names":
        print(*SCENES, *RECORDINGS)
        return 0
    if not args.native or not args.other:
        parser.error("want --native and --other")
    if args.name in RECORDINGS and not DATA.is_dir():
        print(f"skipped: the recordings of ../shared/data are not there: {DATA}")
        return SKIPPED
    with tempfile.TemporaryDirectory() as temporary:
        scene = pathlib.Path(temporary) / "eleven"
        case = {**SCENES, **RECORDINGS}[args.name]
        if case[0] == "SCENE":
            subprocess.run([args.native, "synth", "eleven", "--out", scene, "--frames", "90", "--size", "320x240"],
                           check=True, stdout=subprocess.DEVNULL)
        compare(args.name, args.native, [*args.emulator, args.other], case, scene)
    return 0


if __name__ == "__main__":
    sys.exit(main())
