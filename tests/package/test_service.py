#!/usr/bin/env python3
"""The units and what stands beside them, judged by systemd's own tools, without a systemd that runs.

    test_service.py PROJECT BUILD
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

PROJECT, BUILD = (pathlib.Path(p).resolve() for p in sys.argv[1:3])
SOURCE = PROJECT / "systemd"
UNITS = ["stereotrackd.service", "stereotrackd@.service"]
DROP_INS = sorted((SOURCE / "drop-ins").glob("*.conf"))
MOST_EXPOSED = 1.5


def run(*command):
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)


def put_units(folder, drop_in=None):
    """The units as they are installed, whose program is the one that was built."""
    for unit in UNITS:
        text = (BUILD / "systemd" / unit).read_text()
        assert "/usr/bin/stereotrackd" in text
        (folder / unit).write_text(text.replace("/usr/bin/stereotrackd", str(BUILD / "bin/stereotrackd")))
        if drop_in:
            (folder / f"{unit}.d").mkdir()
            shutil.copy(drop_in, folder / f"{unit}.d")


def exposure(unit):
    told = run("systemd-analyze", "security", "--offline=true", "--no-pager", unit)
    match = re.search(r"Overall exposure level for \S+: ([0-9.]+)", told.stdout)
    assert match, told.stdout + told.stderr
    return float(match[1])


class Units(unittest.TestCase):
    def verify(self, drop_in=None):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            put_units(folder, drop_in)
            done = run("systemd-analyze", "verify", "--man=no", *(folder / unit for unit in UNITS))
            self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "", ""))

    def test_systemd_finds_nothing_to_say(self):
        self.verify()

    def test_nor_of_a_drop_in(self):
        self.assertEqual(len(DROP_INS), 5)
        for drop_in in DROP_INS:
            with self.subTest(drop_in=drop_in.name):
                self.verify(drop_in)

    def test_systemd_would_find_something(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            put_units(folder)
            text = (folder / UNITS[0]).read_text()
            (folder / UNITS[0]).write_text(text.replace("WatchdogSec=", "WatchDogSecs="))
            self.assertIn("WatchDogSecs", run("systemd-analyze", "verify", "--man=no", folder / UNITS[0]).stderr)

    def test_they_are_exposed_no_more_than_promised(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            put_units(folder)
            for unit in UNITS:
                self.assertLessEqual(exposure(folder / unit), MOST_EXPOSED)

    def test_each_drop_in_is_exposed_as_its_head_says(self):
        for drop_in in DROP_INS:
            said = re.search(r"^# .*Exposure ([0-9.]+)\.$", drop_in.read_text(), re.M)
            self.assertIsNotNone(said, drop_in.name)
            with tempfile.TemporaryDirectory() as name, self.subTest(drop_in=drop_in.name):
                folder = pathlib.Path(name)
                put_units(folder, drop_in)
                for unit in UNITS:
                    self.assertLessEqual(exposure(folder / unit), float(said[1]))
        self.assertIn("Exposure 1.5.", (SOURCE / "drop-ins/libcamera.conf").read_text())

    def test_several_rigs_share_nothing_but_the_configuration_directory(self):
        for unit, state, runtime, file in ((UNITS[0], "stereotrack", "stereotrack", "stereotrackd.toml"),
                                           (UNITS[1], "stereotrack/%i", "stereotrack-%i", "%i.toml")):
            text = (BUILD / "systemd" / unit).read_text()
            self.assertIn(f"\nStateDirectory={state}\n", text)
            self.assertIn(f"\nRuntimeDirectory={runtime}\n", text)
            commands = re.findall(r"^Exec\w+=\S+stereotrackd --config (\S+)", text, re.M)
            self.assertEqual(commands, [f"/etc/stereotrack/{file}"] * 2)

    def test_the_page_tells_each_drop_in_with_its_exposure(self):
        page = (PROJECT / "docs/SERVICE.md").read_text()
        for drop_in in DROP_INS:
            said = re.search(r"Exposure ([0-9.]+)\.$", drop_in.read_text(), re.M)[1]
            self.assertRegex(page, rf"\| `{drop_in.name}` .*\| {re.escape(said)} \|")


class Rights(unittest.TestCase):
    def test_the_user_is_made_with_its_groups(self):
        with tempfile.TemporaryDirectory() as name:
            etc = pathlib.Path(name, "etc")
            etc.mkdir()
            (etc / "passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")
            (etc / "group").write_text("root:x:0:\nvideo:x:44:\n")
            done = run("systemd-sysusers", f"--root={name}", SOURCE / "stereotrack.sysusers")
            self.assertEqual(done.returncode, 0, done.stderr)
            users, groups = (etc / "passwd").read_text(), (etc / "group").read_text()
            self.assertRegex(users, r"(?m)^stereotrack:[^:]*:\d+:\d+:Stereo tracker:/var/lib/stereotrack:/usr/sbin/nologin$")
            for group in ("video", "gpio"):
                self.assertRegex(groups, rf"(?m)^{group}:.*:stereotrack$")

    def test_the_state_directory_is_made(self):
        line = (SOURCE / "stereotrack.tmpfiles").read_text().splitlines()[-1]
        self.assertEqual(line, "d /var/lib/stereotrack 0750 stereotrack stereotrack -")
        if os.geteuid() != 0:
            return  # only root can give it away
        with tempfile.TemporaryDirectory() as name:
            etc = pathlib.Path(name, "etc")
            etc.mkdir()
            (etc / "passwd").write_text("root:x:0:0::/:/bin/sh\nstereotrack:x:992:992::/:/bin/sh\n")
            (etc / "group").write_text("root:x:0:\nstereotrack:x:992:\n")
            done = run("systemd-tmpfiles", f"--root={name}", "--create", SOURCE / "stereotrack.tmpfiles")
            self.assertEqual(done.returncode, 0, done.stderr)
            made = pathlib.Path(name, "var/lib/stereotrack").stat()
            self.assertEqual((made.st_uid, made.st_gid, made.st_mode & 0o777), (992, 992, 0o750))

    def test_the_rules_are_rules(self):
        rules = SOURCE / "60-stereotrack.rules"
        if shutil.which("udevadm") and "verify" in run("udevadm", "--help").stdout:
            done = run("udevadm", "verify", rules)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        groups = {"gpio", "video", "stereotrack"}
        known = (SOURCE / "stereotrack.sysusers").read_text()
        lines = [line for line in rules.read_text().splitlines() if line and not line.startswith("#")]
        self.assertGreater(len(lines), 2)
        for line in lines:
            with self.subTest(line=line):
                for part in line.split(", "):
                    self.assertRegex(part, r'^(SUBSYSTEM|KERNEL|ACTION)=="[\w*|-]+"$|^(GROUP|MODE)="\w+"$|^RUN\+="/bin/sh -c [^"]+"$')
                if line.startswith('SUBSYSTEM=="pwm"'):
                    self.assertIn("chgrp -R gpio /sys%p", line)
                    continue
                group = re.search(r'GROUP="(\w+)"', line)[1]
                self.assertIn(group, groups)
                self.assertIn(f" {group}", known)
                self.assertIn('MODE="0660"', line)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
