"""Files changed as accidents and enemies change them: `mutated(content, random)` depends on its arguments alone.

Half of the changes are slight, one number by a little, so that what comes behind a header is reached.  Of the others,
bytes are flipped, cut, moved, doubled, overwritten with the extremes of whole numbers and of floating point; words of
texts are replaced, doubled, exchanged; parts of other files are put in.  Of archives, the members are changed, and the
archive is packed again with checksums that hold: otherwise nothing but the checksums would ever be tested.
"""

from __future__ import annotations

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Sequence

import numpy as np

NUMBERS = (
    0, 1, -1, 2, 127, 128, 255, 256, 32767, 65535, 65536, 1 << 24, (1 << 31) - 1, 1 << 31, (1 << 32) - 1, 1 << 32,
    1 << 40, (1 << 63) - 1, 1 << 63, -(1 << 31), -(1 << 63),
)  # fmt: skip
WORDS = (
    b"0", b"1", b"-1", b"65536", b"4294967296", b"99999999999999999999", b"9" * 5000, b"1e300", b"1e400", b"-1e-300",
    b"nan", b"inf", b"-inf", b"1/0", b"x", b"", b"null", b"true", b"[]", b"{}", b"[[1]]", b'""', b"[" * 3000,
    b"../../x",     b"/etc/passwd", b"\\u0000", b"\0", b"\xff\xfe",
    "\u0663".encode(), b"1_000", b"0x10", b"!!python/object:os.system",
    b"&a [*a]", b"*a", b"{'x': 1}", b"1970-01-01",
)  # fmt: skip
WORD = re.compile(rb"[-+.\w]+|[^\s\w]")
NUMBER = re.compile(rb"(?<![\w.])-?\d[\d.]*")
SLIGHT = 0.5  # of the changes
PNG = b"\x89PNG\r\n\x1a\n"
HEAD = 512  # bytes at the start of a file, which every other change is made in: there its structure is
LONGEST = 1 << 18  # bytes that a file may grow to


def mutated(content: bytes, random: np.random.Generator, others: Sequence[bytes] = ()) -> bytes:
    """The content with some changes, one to four; `others` are files that parts may come from.  It is another."""
    while (made := _mutated(content, random, others)) == content:
        pass
    return made


def _mutated(content: bytes, random: np.random.Generator, others: Sequence[bytes]) -> bytes:
    if content[:4] == b"PK\x03\x04" and random.random() < 0.7:
        return _in_archive(content, random, others)
    if content.startswith(PNG) and random.random() < 0.7:
        return _in_png(content, random)
    if content[8:9] == b"{" and random.random() < 0.7:  # (safetensors: the length of a text, which stays right)
        length = int.from_bytes(content[:8], "little")
        head = _changed(content[8 : 8 + length], random, others, text=True)
        return len(head).to_bytes(8, "little") + head + content[8 + length :]
    return _changed(content, random, others, is_text(content))


def is_text(content: bytes) -> bool:
    """Whether there are words in it rather than bytes."""
    return b"\0" not in content[:4000] and content[:4000].isascii()


def _changed(content: bytes, random: np.random.Generator, others: Sequence[bytes], text: bool) -> bytes:
    data = bytearray(content)
    if random.random() < SLIGHT:
        _slightly_in_words(data, random) if text else _slightly_in_bytes(data, random)
        return bytes(data)
    for _ in range((1, 1, 1, 2, 3, 4)[int(random.integers(6))]):
        _in_words(data, random) if text and random.random() < 0.7 else _in_bytes(data, random, others)
    return bytes(data[: max(LONGEST, len(content))])


def _slightly_in_bytes(data: bytearray, random: np.random.Generator) -> None:
    """One byte a little larger or smaller, or two words that change places; not often where files begin."""
    begin = 0 if random.random() < 0.2 else min(HEAD, len(data) // 2)
    width = 1 << int(random.integers(0, 4))
    at, other = (int(random.integers(begin, len(data) + 1)) // width * width for _ in range(2))
    if random.random() < 0.7:
        step = (1, 1, 2, 16, 128)[int(random.integers(5))] * (1 if random.random() < 0.5 else -1)
        data[at : at + 1] = bytes(byte + step & 255 for byte in data[at : at + 1])
    elif len(data) >= max(at, other) + width:
        data[at : at + width], data[other : other + width] = data[other : other + width], data[at : at + width]


def _slightly_in_words(data: bytearray, random: np.random.Generator) -> None:
    """One number a little larger, smaller, of another sign, or that of another place."""
    start = int(random.integers(0, max(len(data) - 4000, 1)))
    numbers = list(NUMBER.finditer(bytes(data[start : start + 4000])))
    if not numbers:
        _in_words(data, random)
        return
    one, other = (numbers[int(random.integers(len(numbers)))] for _ in range(2))
    digit = int(random.integers(one.start(), one.end()))
    match int(random.integers(0, 5)):
        case 0 if one[0].startswith(b"-"):
            changed = one[0][1:]
        case 0:
            changed = b"-" + one[0]
        case 1:
            changed = other[0]
        case 2:
            changed = one[0] + b"0123456789."[(at := int(random.integers(11))) : at + 1]
        case _:
            changed = bytearray(one[0])
            changed[digit - one.start()] = b"0123456789"[int(random.integers(10))]
    data[start + one.start() : start + one.end()] = changed


def _in_bytes(data: bytearray, random: np.random.Generator, others: Sequence[bytes]) -> None:
    reach = min(len(data), HEAD) if random.random() < 0.3 else len(data)
    at = int(random.integers(0, reach + 1))
    length = 1 << int(random.integers(0, 10))
    match int(random.integers(0, 10)):
        case 0:
            data[at : at + 1] = bytes(byte ^ 1 << int(random.integers(8)) for byte in data[at : at + 1])
        case 1:
            data[at : at + 1] = random.bytes(1)
        case 2:
            del data[at:]
        case 3:
            del data[at : at + length]
        case 4:
            data[at:at] = data[at : at + length]
        case 5:
            data[at : at + length] = (b"\0", b"\xff")[int(random.integers(2))] * len(data[at : at + length])
        case 6:
            data[at:at] = random.bytes(min(length, 64))
        case 7 if others:
            other = others[int(random.integers(len(others)))]
            there = int(random.integers(0, len(other) + 1))
            data[at : at + length] = other[there : there + length]
        case 8:
            to = int(random.integers(0, len(data) + 1))
            part = bytes(data[at : at + length])
            del data[at : at + length]
            data[to:to] = part
        case _:
            width = 1 << int(random.integers(0, 4))
            at -= at % width if random.random() < 0.7 else 0
            data[at : at + width] = _extreme(width, random)


def _extreme(width: int, random: np.random.Generator) -> bytes:
    """A whole number or a floating-point one of so many bytes that few programs expect."""
    if width >= 4 and random.random() < 0.2:
        value = (float("nan"), float("inf"), -1.0, 1e38, 1e-38, 0.0)[int(random.integers(6))]
        return struct.pack("<f" if width == 4 else "<d", value)
    number = NUMBERS[int(random.integers(len(NUMBERS)))] & (1 << 8 * width) - 1
    return number.to_bytes(width, "little" if random.random() < 0.7 else "big")


def _in_words(data: bytearray, random: np.random.Generator) -> None:
    """A word or a line exchanged, doubled or left out."""
    start = int(random.integers(0, max(len(data) - 4000, 1)))
    words = list(WORD.finditer(bytes(data[start : start + 4000])))
    if not words:
        data[:0] = WORDS[int(random.integers(len(WORDS)))]
        return
    one, other = (words[int(random.integers(len(words)))] for _ in range(2))
    begin, end = start + one.start(), start + one.end()
    match int(random.integers(0, 7)):
        case 0 | 1 | 2:
            data[begin:end] = WORDS[int(random.integers(len(WORDS)))]
        case 3:
            data[begin:end] = other[0]
        case 4:
            del data[begin:end]
        case 5:
            stop = data.find(b"\n", begin) + 1 or len(data)
            line = data[begin:stop]
            data[stop:stop] = line * int(random.integers(1, 4))
        case _:
            stop = data.find(b"\n", begin) + 1 or len(data)
            del data[begin:stop]


def _in_archive(content: bytes, random: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """One member changed, or left out, or called like another; the archive is whole."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = [(name, archive.read(name)) for name in archive.namelist()]
    except Exception:  # (what earlier changes have made of it)
        return _changed(content, random, others, text=False)
    at = int(random.integers(len(members))) if members else 0
    if members:
        name, data = members[at]
        match int(random.integers(0, 10)):
            case 0:
                del members[at]
            case 1:
                members[at] = (members[int(random.integers(len(members)))][0], data)
            case 2:
                members[at] = (name, members[int(random.integers(len(members)))][1])
            case 3 | 4 | 5 if data.startswith(b"\x93NUMPY"):
                members[at] = (name, _in_npy(data, random))
            case _:
                members[at] = (name, _changed(data, random, others, is_text(data)))
    packed = io.BytesIO()
    kind = zipfile.ZIP_DEFLATED if random.random() < 0.3 else zipfile.ZIP_STORED
    with zipfile.ZipFile(packed, "w", kind) as archive:
        for name, data in {name: data for name, data in members}.items():
            archive.writestr(zipfile.ZipInfo(name), data, kind)
    return packed.getvalue()


def _in_npy(data: bytes, random: np.random.Generator) -> bytes:
    """The words of the header of an array changed, and its length as it then is."""
    length = int.from_bytes(data[8:10], "little")
    head = bytearray(data[10 : 10 + length])
    for _ in range(int(random.integers(1, 3))):
        _in_words(head, random)
    head = head[:65000]
    return data[:8] + len(head).to_bytes(2, "little") + bytes(head) + data[10 + length :]


def _in_png(content: bytes, random: np.random.Generator) -> bytes:
    """One chunk changed, left out or doubled; checksums hold."""
    chunks, at = [], len(PNG)
    while at + 8 <= len(content) and len(chunks) < 100:
        length = int.from_bytes(content[at : at + 4], "big")
        chunks.append((content[at + 4 : at + 8], content[at + 8 : at + 8 + length]))
        at += 12 + length
    if not chunks:
        return _changed(content, random, (), text=False)
    k = 0 if random.random() < 0.5 else int(random.integers(len(chunks)))
    kind, data = chunks[k]
    match int(random.integers(0, 6)):
        case 0:
            del chunks[k]
        case 1:
            chunks.insert(k, chunks[k])
        case _:
            changed = bytearray(data)
            _in_bytes(changed, random, ())
            chunks[k] = (kind, bytes(changed))
    packed = [len(data).to_bytes(4, "big") + kind + data + _crc(kind + data) for kind, data in chunks]
    return PNG + b"".join(packed)


def _crc(data: bytes) -> bytes:
    return zlib.crc32(data).to_bytes(4, "big")
