"""What a disk may hold after a power loss: replays the calls of a program, as strace saw them, and keeps of them what was synced.

    strace -f -qq -y -xx -s 268435456 -o CALLS -e trace=CALLS_SEEN PROGRAM ...
    python3 disk_states.py CALLS FOLDER STATES

For every moment of the program, two disks: one that has lost all that was not synced, names of files too; and one whose folders
are those of the moment, but whose files end with zeros where their bytes were not synced. Writes each disk that differs from all before as
the folder STATES/NUMBER, as FOLDER would be. Only what is below FOLDER, and FOLDER itself, is seen.
"""

import hashlib
import os
import re
import sys
from pathlib import Path

LINE = re.compile(rb"(\d+) +(.*)")
UNFINISHED = b" <unfinished ...>"
RESUMED = re.compile(rb"<\.\.\. (\w+) resumed>(.*)", re.S)
CALL = re.compile(rb"(\w+)\((.*)\) += (-?\d+)", re.S)
STRING = re.compile(rb'"((?:\\x[0-9a-f]{2})*)"(\.\.\.)?')
DESCRIPTOR = re.compile(rb"(\d+)<")


class File:
    def __init__(self):
        self.content = bytearray()
        self.synced = b""

    def sync(self):
        self.synced = bytes(self.content)


class Folder:
    def __init__(self):
        self.entries = {}
        self.synced = {}

    def sync(self):
        self.synced = dict(self.entries)


def finished_calls(path):
    """(name, arguments, result) of each call in the order in which the calls returned."""
    begun = {}
    for line in path.read_bytes().split(b"\n"):
        match = LINE.fullmatch(line)
        if match is None:
            continue
        process, text = match.groups()
        if text.endswith(UNFINISHED):
            begun[process] = text[: -len(UNFINISHED)]
            continue
        resumed = RESUMED.fullmatch(text)
        call = CALL.match(begun.pop(process) + resumed[2] if resumed else text)
        if call:
            yield call[1].decode(), call[2], int(call[3])


def strings(arguments):
    """The bytes of the strings among a call's arguments."""
    found = []
    for match in STRING.finditer(arguments):
        if match[2]:
            raise SystemExit("a string is cut off: strace needs a larger -s")
        found.append(bytes.fromhex(match[1].replace(rb"\x", b"").decode()))
    return found


class Disk:
    """The files below a folder, as a program sees them and as they are synced."""

    def __init__(self, folder):
        # Beside the folder nothing changes; what holds it is called root here.
        self.top = os.fsencode(folder)
        self.root = Folder()
        self.open = {}

    def place(self, path):
        """The folder that holds a path, and its name there; none if it is not below ours."""
        path = os.path.normpath(path)
        if path != self.top and not path.startswith(self.top + b"/"):
            return None
        *folders, name = os.path.relpath(path, os.path.dirname(self.top)).split(b"/")
        folder = self.root
        for each in folders:
            folder = folder.entries[each]
        return folder, name

    def holder(self, path):
        """What a path names: the parent of our folder is the root, whose own name nobody changes."""
        if os.path.normpath(path) == os.path.dirname(self.top):
            return self.root
        place = self.place(path)
        return place and place[0].entries.get(place[1])

    def replay(self, name, arguments, result):
        """Does what a call did; whether anything changed that a power loss could show."""
        if result < 0:
            return False
        if name == "openat":
            return self.opened(arguments, result)
        if name in ("mkdir", "mkdirat"):
            place = self.place(strings(arguments)[0])
            if place:
                place[0].entries[place[1]] = Folder()
            return place is not None
        if name in ("unlink", "unlinkat", "rmdir"):
            place = self.place(strings(arguments)[0])
            if place:
                del place[0].entries[place[1]]
            return place is not None
        if name in ("rename", "renameat", "renameat2"):
            source, target = map(self.place, strings(arguments))
            if (source is None) != (target is None):
                raise SystemExit("a file is moved into the folder or out of it")
            if source:
                target[0].entries[target[1]] = source[0].entries.pop(source[1])
            return source is not None
        descriptor = int(DESCRIPTOR.match(arguments)[1])
        if name == "close":
            self.open.pop(descriptor, None)
            return False
        if descriptor not in self.open:
            return False
        file, at = self.open[descriptor]
        if name in ("fsync", "fdatasync"):
            file.sync()
        elif name == "ftruncate":
            length = int(arguments.rsplit(b", ", 1)[1])
            file.content = file.content[:length].ljust(length, b"\0")
        elif name == "lseek":
            self.open[descriptor] = (file, result)
            return False
        elif name == "write":
            (written,) = strings(arguments)
            at = len(file.content) if at is None else at
            file.content[at : at + result] = written[:result]
            if self.open[descriptor][1] is not None:
                self.open[descriptor] = (file, at + result)
        else:
            raise SystemExit(f"{name} is not known here")
        return True

    def opened(self, arguments, descriptor):
        self.open.pop(descriptor, None)
        (path,) = strings(arguments)
        found = self.holder(path)
        made = found is None and b"O_CREAT" in arguments and self.place(path) is not None
        if made:
            folder, name = self.place(path)
            found = folder.entries[name] = File()
        if found is None:
            return False
        if b"O_TRUNC" in arguments:
            found.content.clear()
        # None: each write goes to the end.
        self.open[descriptor] = (found, None if b"O_APPEND" in arguments else 0)
        return made or b"O_TRUNC" in arguments

    def after_power_loss(self, names_outlast):
        """Files (bytes) and folders (None) by path: of the folders as they are, or of the synced ones."""
        left = {}

        def walk(folder, path):
            for name, entry in (folder.entries if names_outlast else folder.synced).items():
                if isinstance(entry, Folder):
                    left[path / os.fsdecode(name)] = None
                    walk(entry, path / os.fsdecode(name))
                else:
                    tail = b"\0" * (len(entry.content) - len(entry.synced)) if names_outlast else b""
                    left[path / os.fsdecode(name)] = entry.synced + tail

        walk(self.root, Path())
        return left


def digest(left):
    """What tells disks apart."""
    state = hashlib.sha256()
    for path, content in sorted(left.items()):
        state.update(f"{path} {'folder' if content is None else len(content)}\n".encode())
        state.update(content or b"")
    return state.digest()


def main():
    calls, folder, states = Path(sys.argv[1]), os.path.abspath(sys.argv[2]), Path(sys.argv[3])
    disk, seen = Disk(folder), set()
    for call in finished_calls(calls):
        # A write changes nothing that is synced, and of what is not the lengths alone.
        if not disk.replay(*call) or call[0] == "write":
            continue
        for names_outlast in (False, True):
            left = disk.after_power_loss(names_outlast)
            state = digest(left)
            if state in seen:
                continue
            seen.add(state)
            top = states / f"{len(seen):04}"
            top.mkdir(parents=True)
            for path, content in left.items():
                if content is None:
                    (top / path).mkdir()
                else:
                    (top / path).write_bytes(content)


main()
