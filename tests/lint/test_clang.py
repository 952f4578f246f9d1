#!/usr/bin/env python3
"""Proves that .clang-format and .clang-tidy are on: known-bad snippets must be refused, each for its reason.

A comma that is missing in .clang-tidy, a renamed check or a filter that matches nothing turns lint off without a
word; here it fails.
"""
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]

# check: a snippet that it must refuse. No standard headers, so that each takes a moment.
MOVE = """
namespace std {
template <class T> struct remove_reference { using type = T; };
template <class T> struct remove_reference<T&> { using type = T; };
template <class T> typename remove_reference<T>::type&& move(T&& t) noexcept {
  return static_cast<typename remove_reference<T>::type&&>(t);
}
}
struct Owner { Owner(); Owner(Owner&&) noexcept; Owner(const Owner&); ~Owner(); int size() const; };
"""
BAD_TIDY = {
    "bugprone-use-after-move": MOVE + "int f() { Owner a; Owner b(std::move(a)); return a.size(); }",
    "bugprone-integer-division": "double f(int a, int b) { return a / b; }",
    "bugprone-sizeof-expression": "unsigned long f() { return sizeof(sizeof(3)); }",
    "bugprone-suspicious-semicolon": "void g(); void f(int a) { if (a > 3); g(); }",
    "bugprone-infinite-loop": "int f() { int i = 0; int j = 0; while (i < 10) { ++j; } return j; }",
    "bugprone-unhandled-self-assignment":
        "struct A { A& operator=(const A& o) { delete p_; p_ = new int(*o.p_); return *this; } private: int* p_; };",
    "clang-analyzer-core.NullDereference": "int f(int* p) { if (!p) return *p; return 0; }",
    "clang-analyzer-core.DivideZero": "int f(int a) { int z = 0; return a / z; }",
    "clang-analyzer-cplusplus.NewDeleteLeaks": "int f() { int* p = new int(3); return *p; }",
    "clang-analyzer-deadcode.DeadStores": "int g(); void f() { int a = 0; a = g(); }",
    "performance-move-const-arg": MOVE + "int g(const Owner&); int f() { const Owner a; return g(std::move(a)); }",
    "performance-unnecessary-value-param": MOVE + "int f(Owner a) { return a.size(); }",
    "performance-for-range-copy":
        MOVE + "struct R { Owner* begin() const; Owner* end() const; };\n"
        "int f(const R& r) { int n = 0; for (const Owner a : r) n += a.size(); return n; }",
    "performance-noexcept-move-constructor": "struct A { A(A&&); };",
    "misc-redundant-expression": "bool f(int a) { return a == 3 || a == 3; }",
    "misc-unused-parameters": "int f(int a) { return 3; }",
    "misc-definitions-in-headers": None,  # in the header below
    "misc-unconventional-assign-operator": "struct A { void operator=(const A&); };",
    "modernize-use-nullptr": "int* f() { return 0; }",
    "modernize-use-override": "struct A { virtual ~A(); virtual void f(); }; struct B : A { virtual void f(); };",
    "modernize-use-using": "typedef int Number;",
    "modernize-use-equals-default": "struct A { A() {} int a = 0; };",
    "modernize-loop-convert": "int f() { int a[3] = {1, 2, 3}; int n = 0; for (int i = 0; i < 3; ++i) n += a[i]; return n; }",
    "cppcoreguidelines-slicing":
        "struct A { int a; virtual void f(); protected: ~A(); }; struct B final : A { int b; }; void g(A x);\n"
        "void f(const B& b) { A a = b; (void)a.a; }",
    "cppcoreguidelines-virtual-class-destructor": "struct A { virtual void f(); };",
    "google-build-using-namespace": "namespace n { int a(); } using namespace n;",
    "google-explicit-constructor": "struct A { A(int a); };",
    "readability-container-size-empty":
        "namespace std { template <class T> struct vector { unsigned long size() const; bool empty() const; }; }\n"
        "bool f(const std::vector<int>& v) { return v.size() == 0; }",
    "readability-misleading-indentation": "void g(); void f(bool a) {\n  if (a)\n    g();\n    g();\n}",
    "readability-simplify-boolean-expr": "bool f(bool a) { if (a) return true; else return false; }",
    "readability-redundant-control-flow": "void g(); void f() { g(); return; }",
}
# Names: what each must not be called. [readability-identifier-naming] must fire in every one.
BAD_NAMES = {
    "function": "int GetDepth();",
    "method": "struct A { int getDepth() const; };",
    "type": "struct depth_map {};",
    "alias": "using depth_map = int;",
    "enum": "enum class depth_map { kA };",
    "enum_constant": "enum class A { NONE };",
    "constant": "constexpr int MAX_DEPTH = 3;",
    "global_constant": "const int max_depth = 3;",
    "local": "int f() { int numberOfThings = 3; return numberOfThings; }",
    "parameter": "int f(int numberOfThings) { return numberOfThings; }",
    "private_member": "class A { public: int a() const { return depth; } private: int depth = 0; };",
    "member": "struct A { int depthMax = 0; };",
    "namespace": "namespace DepthMap { int a(); }",
}
# What must stay allowed: the letters of the maths.
GOOD = """
namespace stereotrack {
constexpr int kMostTargets = 3;
constexpr double kNearest_m = 0.5;
enum class Mode { kRegions, kDense };
struct Camera { double fx = 0; double K[9] = {}; double R_left[9] = {}; };
class Filter {
 public:
  explicit Filter(double q) : q_(q) {}
  [[nodiscard]] double innovation(double S, double P_predicted, double T_left_right) const {
    const double K = P_predicted / S;
    const double Z = K * T_left_right;
    return Z * q_;
  }
 private:
  double q_;
};
}  // namespace stereotrack
"""
BAD_HEADER = "#pragma once\nint depth() { return 3; }\n"

# Layout that clang-format must refuse.
BAD_FORMAT = {
    "indentation": "int f() {\n    return 3;\n}\n",
    "pointer": "int *f();\n",
    "brace": "int f()\n{\n  return g(3) + 4;\n}\n",
    "long line": "int f(" + ", ".join(f"int parameter_number_{i}" for i in range(8)) + ");\n",
    "include order": '#include "b.hpp"\n#include "a.hpp"\n',
    "spaces": "int f(int a,int b);\n",
}
GOOD_FORMAT = "int* f(int a, int b);\n\nint g() { return 3; }\n"


def entries_of_config():
    """The globs of Checks, as clang-tidy's YAML reader sees them (folded text, split at commas)."""
    block = re.search(r"^Checks: >\n((?:  .*\n)+)", (ROOT / ".clang-tidy").read_text(), re.M).group(1)
    return [entry.strip() for entry in block.replace("\n", " ").split(",")]


class Tools(unittest.TestCase):
    def test_are_installed(self):
        for tool in ("clang-tidy", "clang-format"):
            self.assertIsNotNone(shutil.which(tool), f"{tool} is missing: ./dev test installs it")


class Tidy(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """All snippets in one run, in a tree like ours, so that lookup and header filter are tested too."""
        cls.folder = tempfile.TemporaryDirectory()
        room = pathlib.Path(cls.folder.name) / "pipeline" / "bad"
        room.mkdir(parents=True)
        shutil.copy(ROOT / ".clang-tidy", cls.folder.name)
        for check, text in BAD_TIDY.items():
            if text:
                (room / f"{check}.cpp").write_text(text + "\n")
        for name, text in BAD_NAMES.items():
            (room / f"name-{name}.cpp").write_text(text + "\n")
        (room / "header.hpp").write_text(BAD_HEADER)
        (room / "header.cpp").write_text('#include "header.hpp"\nint main() { return depth(); }\n')
        (room / "good.cpp").write_text(GOOD)
        files = sorted(str(p) for p in room.glob("*.cpp"))
        done = subprocess.run(["clang-tidy", "--quiet", *files, "--", "-std=c++20"], capture_output=True, text=True,
                              check=False)
        cls.exit_code = done.returncode
        cls.found = {}
        for line in done.stdout.splitlines():
            match = re.match(r"(.*?):\d+:\d+: (error|warning): .* \[([^\]]+)\]$", line)
            if match:
                cls.found.setdefault(pathlib.Path(match.group(1)).name, set()).update(match.group(3).split(","))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_each_check_refuses_its_snippet_as_an_error(self):
        for check in BAD_TIDY:
            file = "header.hpp" if check == "misc-definitions-in-headers" else f"{check}.cpp"
            with self.subTest(check=check):
                self.assertIn(check, self.found.get(file, set()))
                self.assertIn("-warnings-as-errors", self.found[file])
        self.assertNotEqual(self.exit_code, 0)

    def test_names_out_of_style_are_refused(self):
        for name in BAD_NAMES:
            with self.subTest(name=name):
                self.assertIn("readability-identifier-naming", self.found.get(f"name-{name}.cpp", set()))

    def test_findings_in_our_headers_are_told(self):
        self.assertIn("header.hpp", self.found)

    def test_good_code_passes(self):
        self.assertEqual(self.found.get("good.cpp", set()), set())

    def test_each_entry_of_the_configuration_means_something(self):
        for entry in entries_of_config():
            if entry == "-*":
                continue
            with self.subTest(entry=entry):
                self.assertRegex(entry, r"^-?[a-z][\w.\-*]+$")
                done = subprocess.run(["clang-tidy", f"--checks=-*,{entry.lstrip('-')}", "--list-checks"],
                                      capture_output=True, text=True, check=False)
                self.assertIn("Enabled checks:", done.stdout, f"{entry} names no check of this clang-tidy")

    def test_each_family_of_the_configuration_has_a_snippet(self):
        families = {e.split("-")[0] for e in entries_of_config() if not e.startswith("-")}
        shown = {c.split("-")[0] for c in BAD_TIDY}
        self.assertEqual(families - shown, set())


class Format(unittest.TestCase):
    def refused(self, text):
        done = subprocess.run(["clang-format", "--dry-run", "-Werror", "--assume-filename", str(ROOT / "pipeline/x.cpp")],
                              input=text, capture_output=True, text=True, check=False)
        return done.returncode != 0

    def test_bad_layout_is_refused(self):
        for name, text in BAD_FORMAT.items():
            with self.subTest(name=name):
                self.assertTrue(self.refused(text))

    def test_good_layout_passes(self):
        self.assertFalse(self.refused(GOOD_FORMAT))


if __name__ == "__main__":
    unittest.main()
