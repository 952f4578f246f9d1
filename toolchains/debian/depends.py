#!/usr/bin/env python3
"""What a package depends on, read from its programs as dpkg-shlibdeps reads it, but of any architecture and out of a
sysroot: dpkg-shlibdeps asks the dpkg of the machine that it runs on.

    depends.py --admindir FOLDER --architecture ARCH ELF...      one line: PACKAGE (>= VERSION), ...

FOLDER: the var/lib/dpkg of a Debian of that architecture, of which info/ is read. Each library that an ELF needs is looked up
in *.symbols (the version that has all symbols that are used) or, where a library has none, in *.shlibs. One that no package
tells of is an error: what is built against it would not start.
"""
import argparse
import collections
import functools
import pathlib
import re
import subprocess
import sys


class DependsError(Exception):
    """One line."""


def readelf(*arguments):
    done = subprocess.run(["readelf", "-W", *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise DependsError(f"readelf: {done.stderr.strip()}")
    return done.stdout


def needed_by(elf):
    return re.findall(r"\(NEEDED\).*\[(.+)\]", readelf("-d", elf))


def symbols_wanted_by(elf):
    """NAME@VERSION, Base where there is no version, as dpkg's files have it."""
    for line in readelf("--dyn-syms", elf).splitlines():
        parts = line.split()
        if len(parts) > 7 and parts[0][:-1].isdigit() and parts[6] == "UND":
            name, _, version = parts[7].replace("@@", "@").partition("@")
            yield f"{name}@{version or 'Base'}"


def is_newer(one, other):
    """As dpkg orders versions."""
    return subprocess.run(["dpkg", "--compare-versions", one, "gt", other], check=False).returncode == 0


def newest(versions):
    return functools.reduce(lambda best, one: one if is_newer(one, best) else best, sorted(set(versions)))


class Library:
    """A library's part of a file of symbols: what a user of its symbols depends on."""

    def __init__(self, template):
        self.templates = [template]
        self.symbols = {}  # NAME@VERSION -> (since, number of the template)

    def depends(self, wanted):
        used = [self.symbols[name] for name in wanted if name in self.symbols]
        # Who uses none of them all the same needs the library.
        used = used or [("", 0)]
        for number in sorted({number for _, number in used}):
            since = [version for version, of in used if of == number and version]
            # 0: in any version.
            bound = f"(>= {newest(since)})" if since and newest(since) != "0" else ""
            yield self.templates[number].replace("#MINVER#", bound).strip()


def read_symbols(text, libraries):
    library = None
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        if line.startswith("|"):
            library.templates.append(line[1:].strip())
        elif line.startswith("*"):
            continue
        elif not line.startswith(" "):
            soname, template = line.split(None, 1)
            library = Library(template)
            # Of a soname that is known already, this one is for nobody.
            libraries.setdefault(soname, library)
        else:
            name, since, *number = line.split()
            library.symbols[name] = (since, int(number[0]) if number else 0)


def read_shlibs(text, depends):
    for line in text.splitlines():
        # [TYPE:] LIBRARY VERSION DEPENDENCIES; those with a type are for installers.
        if match := re.fullmatch(r"(\S+) (\S+)(?: (.*))?", line.strip()):
            library, version, wanted = match.groups()
            if not library.endswith(":") and not library.startswith("#"):
                for soname in (f"{library}.so.{version}", f"{library}-{version}.so"):
                    depends.setdefault(soname, wanted or "")


class Dpkg:
    """What the packages of one architecture tell of their libraries."""

    def __init__(self, admindir, architecture):
        self.info = admindir / "info"
        self.libraries = {}
        self.shlibs = {}
        for kind, read, into in (("symbols", read_symbols, self.libraries), ("shlibs", read_shlibs, self.shlibs)):
            # Those with an architecture in their names first: the others may be for programs of another one.
            for path in sorted(self.info.glob(f"*.{kind}"), key=lambda path: (":" not in path.name, path.name)):
                of = path.name.removesuffix(f".{kind}").partition(":")[2]
                if of in ("", architecture):
                    read(path.read_text(), into)
        if not self.libraries and not self.shlibs:
            raise DependsError(f"{self.info}: no *.symbols and *.shlibs: want the var/lib/dpkg of a Debian "
                               "(toolchains/make_sysroot.sh makes one)")

    def depends(self, elf):
        wanted = list(symbols_wanted_by(elf))
        for soname in needed_by(elf):
            if soname in self.libraries:
                yield from self.libraries[soname].depends(wanted)
            elif soname in self.shlibs:
                yield self.shlibs[soname]
            else:
                raise DependsError(f"{elf}: needs {soname}, and no package in {self.info} tells of it")


def simplified(dependencies):
    """Of each package one, with the newest version."""
    packages = collections.defaultdict(list)
    for one in dependencies:
        for dependency in filter(None, (part.strip() for part in one.split(","))):
            # What offers a choice is kept as it is.
            name, _, rest = (dependency, "", "") if "|" in dependency else dependency.partition(" ")
            packages[name].append(rest)
    for name in sorted(packages):
        bounds = {rest for rest in packages[name] if rest}
        lower = [match[1] for rest in bounds if (match := re.fullmatch(r"\(>= (.+)\)", rest))]
        if lower:
            yield f"{name} (>= {newest(lower)})"
        others = sorted(rest for rest in bounds if not re.fullmatch(r"\(>= (.+)\)", rest))
        yield from (f"{name} {rest}" for rest in others)
        if not bounds:
            yield name


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--admindir", required=True, type=pathlib.Path)
    parser.add_argument("--architecture", required=True)
    parser.add_argument("elf", nargs="+", type=pathlib.Path)
    args = parser.parse_args()
    try:
        dpkg = Dpkg(args.admindir, args.architecture)
        print(", ".join(simplified(one for elf in args.elf for one in dpkg.depends(elf))))
    except DependsError as error:
        print(f"depends.py: {error}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
