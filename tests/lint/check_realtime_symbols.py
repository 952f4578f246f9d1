#!/usr/bin/env python3
"""Proves at link level what real-time threads may call: check_realtime_symbols.py [--threads] [--root NAME] OBJECT...

The objects are compiled with -ffunction-sections -fdata-sections, so that each function and each table is a section of
its own and each call, each address taken, is a relocation. From the roots the relocations are walked from section to
section. What is reached must be a section of these objects or a symbol on a short list.

Without --threads: the objects of pipeline/, from Pipeline::run, and the list LOOP. What only create() or the program's
start reaches may besides use SET_UP. Nothing else may be referenced at all: no heap, lock, thread, clock, file, stream,
locale, std::function, exception or guarded static.

With --threads: those and the rooms around them, from the bodies of the daemon's threads and the functions that they
call through a table (ROOTS_OF_THREADS, each of which must be there), and the list LOOP and THREADS: a clock, a sleep,
a futex, a datagram, a line. What only the start reaches is not judged.

Not seen: what a function pointer does that is no root, and what a symbol of the list does inside its library.
A breach is one line, OBJECT: FUNCTION: calls SYMBOL, with the way that leads there from the root. Exit 1 if there is
any, 2 if an object cannot be judged. test_realtime_symbols.py breaks each rule.
"""
import argparse
import collections
import pathlib
import re
import struct
import subprocess
import sys

ROOT = "stereotrack::Pipeline::run("
ROOTS_OF_THREADS = [
    "stereotrack::daemon::capture(",
    "stereotrack::daemon::FrameLoop::run(",
    "stereotrack::daemon::Publisher::run(",
    "stereotrack::daemon::give_pulses(",
    # Through a table, or a pointer.
    "stereotrack::daemon::FrameLoop::stage_ended(",
    "stereotrack::capture::Film::step(",
    "stereotrack::capture::Film::clock_map(",
    "stereotrack::capture::StereoCameras::step(",
    "stereotrack::capture::StereoCameras::figures(",
    "stereotrack::capture::libcamera::Stream::take(",
    "stereotrack::capture::libcamera::Stream::give_back(",
    "stereotrack::capture::libcamera::Stream::picture(",
    "stereotrack::capture::libcamera::Stream::clock_map(",
    "stereotrack::capture::libcamera::Stream::counters(",
    # Of its module, through a table of C functions.
    "stereotrack::libcamera_module::Handover::take(",
    "stereotrack::libcamera_module::Handover::give_back(",
    "stereotrack::capture::v4l2::Stream::take(",
    "stereotrack::capture::v4l2::Stream::give_back(",
    "stereotrack::capture::v4l2::Stream::picture(",
    "stereotrack::capture::v4l2::Stream::counters(",
    "stereotrack::trigger::PulseTrain::Told::take(",
    "stereotrack::trigger::EdgeTrigger::take(",
    "stereotrack::telemetry::UdpSender::send(",
    "stereotrack::gpio::gpiod::(anonymous namespace)::Request::set(",
    "stereotrack::gpio::simulated_chip::(anonymous namespace)::Request::set(",
    "stereotrack::gpio::gpiod::(anonymous namespace)::Inputs::read(",
    "stereotrack::gpio::gpiod::(anonymous namespace)::Inputs::probe(",
]

# Demangled names in full.
LOOP = [
    r"mem(cpy|move|set|cmp)",                   # the compiler's own
    r"(sqrt|floor|ceil|trunc|round|rint|nearbyint|fmod|l?lround|l?lrint)f?",  # exact by IEEE 754, no state but errno
    r"hwy::(GetChosenTarget|SupportedTargets)\(\)",  # the table of instruction sets, detected once at start
    r"_GLOBAL_OFFSET_TABLE_",
    r"__stack_chk_(fail|guard)|__mem(cpy|move|set)_chk",  # a hardened build's: they end the program
    r"__(u?(div|mod)[sdt]i[34]|popcount[sdt]i2|clz[sdt]i2|ctz[sdt]i2)",  # libgcc: arithmetic that the CPU lacks
    r"__aeabi_u?(idiv|idivmod|ldivmod)|__aeabi_(mem(cpy|move|set|clr)[48]?|d2u?lz|f2u?lz|u?l2[df]|llsl|llsr|lasr|lmul)",
]
SET_UP = [
    r"operator new\(unsigned (long|int), std::align_val_t, std::nothrow_t const&\)",  # Arena
    r"operator delete\(void\*, std::align_val_t\)",
    r"std::nothrow",
]

THREADS = [
    r"clock_gettime|clock_nanosleep|adjtimex",
    r"syscall|ppoll|sendto|ioctl",  # futexes, frames, datagrams
    r"read|write",            # of an event's descriptor that does not wait
    r"__errno_location|pow",  # pow: a gain that is told in decibels
    r"stereotrack::allocations_of_this_thread\(\)",  # the program's own count
    r"pb_(encode|get_encoded_size|ostream_from_buffer)",  # nanopb: into the caller's memory, no heap
    r"stereotrack_Datagram_msg",                          # its table of the schema
    r"crypto_generichash",  # libsodium: no heap
    r"gpiod_line_set_value_bulk|gpiod_line_request_set_values",  # one ioctl
    r"poll|epoll_ctl",  # edges of an external trigger: poll with no wait
    r"gpiod_line_event_read_multiple|gpiod_line_get_value",  # one read, one ioctl
    r"gpiod_line_request_(wait|read)_edge_events?|gpiod_line_request_get_values_subset",  # the same of libgpiod 2
    r"gpiod_edge_event_(buffer_get_event|get_[a-z_]+)",  # of a buffer that is there
]

SHF_ALLOC = 2
SHT_SYMTAB, SHT_RELA, SHT_REL = 2, 4, 9
SHN_UNDEF, SHN_LORESERVE, SHN_XINDEX = 0, 0xFF00, 0xFFFF
STB_LOCAL = 0
STT_FUNC = 2

Symbol = collections.namedtuple("Symbol", "name section local function")


class BadObject(Exception):
    pass


class ObjectFile:
    """Sections, symbols and relocations of one ELF object: sections[i] = name, calls[i] = symbols that i refers to."""

    def __init__(self, path):
        self.name = pathlib.Path(path).name
        data = pathlib.Path(path).read_bytes()
        if data[:4] != b"\x7fELF" or data[5] != 1:
            raise BadObject(f"{path}: not an object file of a little-endian ELF machine")
        wide = data[4] == 2
        if struct.unpack_from("<H", data, 16)[0] != 1:
            raise BadObject(f"{path}: linked already; want an object file")
        offset, = struct.unpack_from("<Q" if wide else "<I", data, 40 if wide else 32)
        size, count, names = struct.unpack_from("<HHH", data, 58 if wide else 46)
        form = "<IIQQQQIIQQ" if wide else "<IIIIIIIIII"
        header = lambda i: struct.unpack_from(form, data, offset + i * size)
        if count == 0:  # more than fit in the header's field
            count = header(0)[5]
        if names == SHN_XINDEX:
            names = header(0)[6]
        headers = [header(i) for i in range(count)]

        def text(table, at):
            begin = headers[table][4] + at
            return data[begin:data.index(b"\0", begin)].decode()

        self.sections = [text(names, h[0]) for h in headers]
        self.allocated = [bool(h[2] & SHF_ALLOC) for h in headers]
        self.symbols = []
        for h in headers:
            if h[1] != SHT_SYMTAB:
                continue
            for at in range(h[4], h[4] + h[5], h[9]):
                if wide:
                    name, info, _, section = struct.unpack_from("<IBBH", data, at)
                else:
                    name, _, _, info, _, section = struct.unpack_from("<IIIBBH", data, at)
                if section == SHN_XINDEX:
                    raise BadObject(f"{path}: more than 65279 sections")
                self.symbols.append(Symbol(text(h[6], name), section, info >> 4 == STB_LOCAL, info & 15 == STT_FUNC))
        self.calls = collections.defaultdict(list)
        for h in headers:
            if h[1] not in (SHT_RELA, SHT_REL) or not self.allocated[h[7]]:
                continue
            for at in range(h[4], h[4] + h[5], h[9]):
                info, = struct.unpack_from("<Q" if wide else "<I", data, at + (8 if wide else 4))
                index = info >> (32 if wide else 8)
                if index != 0:
                    self.calls[h[7]].append(self.symbols[index])

    def functions(self):
        return [s for s in self.symbols if s.function and SHN_UNDEF < s.section < SHN_LORESERVE]


def demangle(names):
    names = sorted(names)
    done = subprocess.run(["c++filt"], input="\n".join(names) + "\n", capture_output=True, text=True, check=True)
    return dict(zip(names, done.stdout.splitlines()))


def on_list(name, patterns):
    return any(re.fullmatch(pattern, name) for pattern in patterns)


class Program:
    def __init__(self, objects):
        self.objects = objects
        self.plain = demangle({s.name for o in objects for s in o.symbols if s.name})
        self.plain[""] = ""
        self.defined = {}  # global symbol: (object, section); of several equal inline functions the first, as ld does
        for o in objects:
            for s in o.symbols:
                if not s.local and SHN_UNDEF < s.section < SHN_LORESERVE:
                    self.defined.setdefault(s.name, (o, s.section))
        self.labels = {}  # (object, section): the function in it, for people
        for o in objects:
            for s in o.functions():
                self.labels.setdefault((o, s.section), self.plain[s.name])

    def target(self, o, symbol):
        """(object, section) where it stands, or None where none of the objects has it."""
        if symbol.local:
            return (o, symbol.section) if SHN_UNDEF < symbol.section < SHN_LORESERVE else None
        return self.defined.get(symbol.name)

    def label(self, place):
        return self.labels.get(place) or place[0].sections[place[1]]

    def reach(self, roots):
        """All places that the functions named so... lead to: place -> the place that it was found from."""
        found = {}
        for root in roots:
            places = {(o, s.section) for o in self.objects for s in o.functions() if self.plain[s.name].startswith(root)}
            if not places:
                raise BadObject(f"no function {root}...) in these objects: nothing to begin at")
            found.update((place, None) for place in places)
        queue = collections.deque(found)
        while queue:
            place = queue.popleft()
            for symbol in place[0].calls[place[1]]:
                target = self.target(place[0], symbol)
                if target is not None and target not in found:
                    found[target] = place
                    queue.append(target)
        return found

    def outside(self, o, section):
        """Symbols that no object has, as people read them."""
        return sorted({self.plain[s.name] for s in o.calls[section] if s.name and self.target(o, s) is None})


def short(name):
    """Without arguments and template arguments, of which there may be screens full."""
    while True:
        shorter = re.sub(r"<[^<>]*>|\((?!anonymous)[^()]*\)(?: const)?|\[[^\[\]]*\]", "", name)
        if shorter == name:
            return name
        name = shorter


def findings(program, reached, allowed_there, allowed_else):
    """`allowed_else`: of what is not reached; None: that is not judged."""
    for o in program.objects:
        # Calls inside a section have no relocation: the walk would miss them.
        if any(o.sections[s.section] == ".text" for s in o.functions()):
            raise BadObject(f"{o.name}: compiled without -ffunction-sections")
        for section in sorted(o.calls):
            place = (o, section)
            if o.sections[section].startswith((".eh_frame", ".note", ".ARM.ex")):
                continue
            allowed = allowed_there if place in reached else allowed_else
            if allowed is None:
                continue
            for symbol in program.outside(o, section):
                if on_list(symbol, allowed):
                    continue
                way = []
                at = reached.get(place)
                while at is not None:
                    way.append(short(program.label(at)))
                    at = reached[at]
                told = "; from " + " > ".join(reversed(way)) if way else "" if place in reached else "; set-up"
                yield f"{o.name}: {short(program.label(place))}: calls {symbol}{told}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", help="begin at this function instead, demangled, up to its '('")
    parser.add_argument("--threads", action="store_true", help="of the daemon's threads, not of the frame loop alone")
    parser.add_argument("--list", action="store_true", help="show what is reached outside, and end")
    parser.add_argument("objects", nargs="+")
    arguments = parser.parse_args()
    roots = [arguments.root] if arguments.root else ROOTS_OF_THREADS if arguments.threads else [ROOT]
    try:
        program = Program([ObjectFile(path) for path in arguments.objects])
        reached = program.reach(roots)
        if arguments.list:
            for symbol in sorted({s for o, section in reached for s in program.outside(o, section)}):
                print(symbol)
            return 0
        lists = (LOOP + THREADS, None) if arguments.threads else (LOOP, LOOP + SET_UP)
        breaches = list(findings(program, reached, *lists))
    except BadObject as error:
        print(f"check_realtime_symbols.py: {error}", file=sys.stderr)
        return 2
    for breach in breaches:
        print(breach)
    functions = sum(1 for place in reached if place in program.labels)
    print(f"real time: {len(program.objects)} objects, {functions} functions reached, {len(breaches)} breaches")
    return 1 if breaches else 0


if __name__ == "__main__":
    sys.exit(main())
