#!/usr/bin/env python3
"""Each toolchain file builds against a sysroot what then runs in the emulator, and says what it lacks.

    test_toolchains.py SYSROOT TRIPLET [unittest arguments]

SYSROOT also serves as that of SDKs, whose environment is made here as Yocto and Buildroot make it.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
CORES = ["cortex-a53", "cortex-a72", "cortex-a76"]
sysroot, triplet = sys.argv[1:3]
release = "trixie" if pathlib.Path(sysroot).name.startswith("trixie") else "bookworm"
libraries = f"{sysroot}/usr/lib/{triplet}"
of_gcc = max(pathlib.Path(f"{sysroot}/usr/lib/gcc/{triplet}").iterdir(), key=lambda folder: int(folder.name))
# Clang 14 does not read the C++ library of GCC 14.
clang, clangxx, lld = ("clang-19", "clang++-19", "ld.lld-19") if release == "trixie" else ("clang", "clang++", "ld.lld")
# Where Debian keeps what an SDK's compiler has in its own places.
words = f"-B{libraries} -L{libraries} -L{of_gcc}"
if triplet.startswith("arm"):
    words += " -mfpu=neon-vfpv4 -mfp16-format=ieee"


class Toolchains(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.build = pathlib.Path(folder.name) / "build"

    def call(self, *command, env=None):
        clean = {name: value for name, value in os.environ.items() if name not in ("CC", "CXX", "CFLAGS", "CXXFLAGS",
                                                                                   "STEREOTRACK_BOARD_CACHE")}
        done = subprocess.run(command, capture_output=True, text=True, env={**clean, **(env or {})})
        return done.returncode, done.stdout + done.stderr

    def configure(self, toolchain, *options, env=None):
        return self.call("cmake", "-G", "Ninja", "-S", ROOT / "tests/emulated/toolchain", "-B", self.build,
                         "--toolchain", ROOT / "toolchains" / toolchain, *options, env=env)

    def builds_and_runs(self, toolchain, *options, env=None):
        code, said = self.configure(toolchain, *options, env=env)
        self.assertEqual(code, 0, said)
        # From here on without the environment: it is kept.
        code, said = self.call("cmake", "--build", self.build, "-v")
        self.assertEqual(code, 0, said)
        code, ran = self.call("ctest", "--test-dir", self.build, "-V")
        self.assertEqual(code, 0, ran)
        return said, ran

    def test_gcc_for_any_core(self):
        said, _ = self.builds_and_runs(f"{triplet}.cmake", f"-DSTEREOTRACK_SYSROOT={sysroot}",
                                       f"-DSTEREOTRACK_DEBIAN={release}")
        self.assertNotIn("-mcpu", said)
        self.assertNotIn("-march=native", said)

    def test_gcc_for_each_core(self):
        for core in CORES:
            with self.subTest(core):
                shutil.rmtree(self.build, ignore_errors=True)
                said, _ = self.builds_and_runs(f"{triplet}.cmake", f"-DSTEREOTRACK_SYSROOT={sysroot}",
                                               f"-DSTEREOTRACK_DEBIAN={release}", f"-DSTEREOTRACK_CPU={core}")
                self.assertIn(f"-mcpu={core}", said)

    def test_clang(self):
        if not (shutil.which(clangxx) and shutil.which(lld)):
            self.fail(f"{clangxx} and {lld} are not installed: packages.txt names them for this preset")
        said, _ = self.builds_and_runs(f"{triplet}.cmake", f"-DSTEREOTRACK_SYSROOT={sysroot}",
                                       f"-DSTEREOTRACK_DEBIAN={release}", f"-DSTEREOTRACK_COMPILER={clang}")
        self.assertIn(clangxx, said)

    def test_environment_of_a_yocto_sdk(self):
        hardened = "-fstack-protector-strong -D_FORTIFY_SOURCE=2"
        compiler = {name: f"{triplet}-{program} {hardened} {words} --sysroot={sysroot}"
                    for name, program in (("CC", "gcc"), ("CXX", "g++"))}
        said, _ = self.builds_and_runs("sdk.cmake", env={
            **compiler, "CFLAGS": " -O2 -pipe -g", "CXXFLAGS": " -O2 -pipe -DOF_THE_SDK",
            "LDFLAGS": "-Wl,-O1 -Wl,--as-needed", "SDKTARGETSYSROOT": sysroot, "OECORE_TARGET_SYSROOT": sysroot,
            "OECORE_TARGET_ARCH": triplet.split("-")[0]})
        for flag in ("-fstack-protector-strong", "-DOF_THE_SDK", "-Wl,--as-needed"):
            self.assertIn(flag, said)

    def test_environment_of_a_buildroot_sdk(self):
        self.builds_and_runs("sdk.cmake", env={
            "CC": f"{triplet}-gcc", "CXX": f"{triplet}-g++", "CFLAGS": f"-O2 {words}", "CXXFLAGS": f"-O2 {words}",
            "LDFLAGS": words, "STAGING_DIR": sysroot})

    def test_no_environment_is_told(self):
        code, said = self.configure("sdk.cmake")
        self.assertNotEqual(code, 0)
        self.assertIn("source the SDK's environment-setup file first", " ".join(said.split()))

    def test_no_sysroot_is_told_with_the_way_to_one(self):
        for options in ([], ["-DSTEREOTRACK_SYSROOT=/nonexistent"]):
            code, said = self.configure(f"{triplet}.cmake", *options, env={"STEREOTRACK_BOARD_CACHE": "/nonexistent"})
            self.assertNotEqual(code, 0)
            self.assertIn("toolchains/make_sysroot.sh bookworm-", " ".join(said.split()))

    def test_another_compiler_is_refused(self):
        code, said = self.configure(f"{triplet}.cmake", f"-DSTEREOTRACK_SYSROOT={sysroot}",
                                    "-DSTEREOTRACK_COMPILER=icc")
        self.assertNotEqual(code, 0)
        self.assertIn("want gcc, clang, or clang-VERSION", " ".join(said.split()))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
