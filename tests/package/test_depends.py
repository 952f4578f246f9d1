#!/usr/bin/env python3
"""toolchains/debian/depends.py tells what dpkg-shlibdeps tells, where that can be asked; and what it refuses.

    test_depends.py PROJECT BUILD
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest

PROJECT, BUILD = (pathlib.Path(p).resolve() for p in sys.argv[1:3])
SCRIPT = PROJECT / "toolchains/debian/depends.py"
ADMIN = pathlib.Path("/var/lib/dpkg")
PROGRAMS = [BUILD / "bin/stereotrackd", BUILD / "bin/stereotrack", *(BUILD / "lib/stereotrack").glob("*.so")]


def architecture():
    return subprocess.run(["dpkg", "--print-architecture"], capture_output=True, text=True, check=True).stdout.strip()


def told(*elves, admindir=ADMIN):
    return subprocess.run([sys.executable, SCRIPT, "--admindir", admindir, "--architecture", architecture(), *elves],
                          capture_output=True, text=True, check=False)


def set_of(text):
    return {one.strip() for one in text.split(",")}


class Depends(unittest.TestCase):
    def test_it_tells_what_dpkg_tells(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "debian").mkdir()
            (folder / "debian/control").write_text("Source: x\n\nPackage: x\nArchitecture: any\n")
            for program in PROGRAMS:
                with self.subTest(program=program.name):
                    done = subprocess.run(["dpkg-shlibdeps", "-O", program], cwd=folder, capture_output=True, text=True,
                                          check=False)
                    self.assertEqual(done.returncode, 0, done.stderr)
                    ours = told(program)
                    self.assertEqual(ours.returncode, 0, ours.stderr)
                    self.assertEqual(set_of(ours.stdout), set_of(done.stdout.split("Depends=")[1]))

    def test_of_two_programs_the_newest_version_counts(self):
        both = set_of(told(*PROGRAMS[:2]).stdout)
        self.assertEqual(len({one.split()[0] for one in both}), len(both))
        for program in PROGRAMS[:2]:
            self.assertLessEqual({one.split()[0] for one in set_of(told(program).stdout)}, {one.split()[0] for one in both})

    def test_a_library_of_no_package_is_an_error(self):
        with tempfile.TemporaryDirectory() as name:
            info = pathlib.Path(name, "info")
            info.mkdir()
            (info / "libc6.shlibs").write_text("libc 6 libc6 (>= 2.36)\n")
            done = told(PROGRAMS[0], admindir=pathlib.Path(name))
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, r"^depends\.py: .*stereotrackd: needs \S+, and no package in ")

    def test_a_folder_without_dpkg_is_an_error_with_the_way_out(self):
        done = told(PROGRAMS[0], admindir=pathlib.Path("/nowhere"))
        self.assertEqual(done.returncode, 1)
        self.assertIn("make_sysroot.sh", done.stderr)

    def test_versions_are_ordered_as_dpkg_orders_them_and_a_choice_stays(self):
        with tempfile.TemporaryDirectory() as name:
            info = pathlib.Path(name, "info")
            info.mkdir()
            needed = subprocess.run(["readelf", "-dW", PROGRAMS[0]], capture_output=True, text=True, check=True).stdout
            for line in needed.splitlines():
                if "NEEDED" not in line:
                    continue
                soname = line.split("[")[1].rstrip("]")
                wanted = "one (>= 2~rc1) | other" if soname.startswith("libsodium") else "all (>= 1.10)"
                if soname.startswith("libstdc++"):
                    wanted = "all (>= 1.9)"
                (info / f"{soname}.symbols").write_text(f"{soname} {wanted}\n")
            done = told(PROGRAMS[0], admindir=pathlib.Path(name))
            self.assertEqual(set_of(done.stdout), {"all (>= 1.10)", "one (>= 2~rc1) | other"}, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
