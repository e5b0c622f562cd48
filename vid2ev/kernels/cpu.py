"""The walk on a CPU: blocks of pixels; scan, gather what is flagged, solve."""

from __future__ import annotations

import numpy as np

from vid2ev.compiling.compiler import compiled, inner
from vid2ev.compiling.intrinsics import from_entry, prefetch, put_eight
from vid2ev.kernels.crossing import cross
from vid2ev.kernels.forced import candidates, keep_likely, place_of_candidate
from vid2ev.kernels.general import walk_pixel
from vid2ev.kernels.layout import BLOCK, HIGH, LANE_COUNT, LOW, PITCH, STRIP, stride_of
from vid2ev.kernels.light import read_light
from vid2ev.kernels.naps import AWAKE, give_back, of_frame
from vid2ev.kernels.rows import RISEN, interval_of_row
from vid2ev.kernels.scan import commit, scan
from vid2ev.kernels.scratch import NEW
from vid2ev.kernels.settle import settle_lanes, shift_pixel
from vid2ev.kernels.shots import aim
from vid2ev.kernels.sleep import doze, next_run, stir
from vid2ev.kernels.slow import climb, load
from vid2ev.kernels.steep import forget_rests, note_rests

AHEAD = 64  # entries of float32 in four lines of a cache

_BYTES = np.uint64(0x0101010101010101)  # times this, the top byte is the sum of all; times the next, they are its bits
_BITS = np.uint64(0x0102040810204080)
_SET = np.zeros(256, np.uint64)  # the numbers of the bits that are set, ascending, a byte each, and zeros
for _bits in range(256):
    _SET[_bits] = sum(bit << 8 * k for k, bit in enumerate(bit for bit in range(8) if _bits >> bit & 1))


@inner
def hits_of(flagged, hits):
    """Indices of the flagged pixels of a block into `hits` (BLOCK + 8 long); returns their number.

    No branch depends on a pixel: of each eight as many entries are written, and those without a flag are overwritten.
    """
    words = flagged.view(np.uint64)
    total = np.uint64(0)
    for k in range(words.size):
        total |= words[k]
    count = np.int64(0)
    if total == 0:
        return count
    for k in range(words.size):
        put_eight(hits, count, np.int32(8 * k), _SET[(words[k] * _BITS) >> np.uint64(56)])
        count += np.int64((words[k] * _BYTES) >> np.uint64(56))  # (flags are 0 or 1)
    return count


@compiled
def walk_tile(
    first_block, last_block, light, places, lut, naps, planes, flags, num, floats, ints, ends, work, out, tally
):
    """Advance blocks first_block ... last_block - 1 through some frames; returns the keys of their events.

    The light of frame k is as long as `light` [pixels], and begins at entry places[k] counted from the first of that;
    its interval is in row k of floats and ints (`kernels.rows`).  The blocks go in groups, each through all frames
    before the next one begins, so that its state stays in the cache: ends [groups, frames] becomes how many keys there
    are after each frame of each.
    """
    n, pixels = np.int64(0), np.int64(light.size)
    groups, blocks = ends.shape[0], last_block - first_block
    for group in range(groups):
        first, last = first_block + blocks * group // groups, first_block + blocks * (group + 1) // groups
        for k in range(ends.shape[1]):
            if len(flags.leak) and floats[k, RISEN] > 0.0:
                lift(first, last, pixels, floats[k, RISEN], naps, planes, flags, num, work)
            iv = interval_of_row(floats[k], ints[k])
            out, n = walk_blocks(
                first, last, pixels, from_entry(light, places[k]), lut, of_frame(naps, k), planes, flags, num, iv, work,
                out, n, tally,
            )  # fmt: skip
            ends[group, k] = n
    return out


@inner
def lift(first_block, last_block, pixels, risen, naps, planes, flags, num, work):
    """Take what the leak has risen into the memories of blocks; nobody there sleeps on without having been asked."""
    first, last = first_block * BLOCK, min(last_block * BLOCK, pixels)
    for pixel in range(first, last):
        shift_pixel(pixel, risen, planes, flags, num, work)
    if naps.wanted:
        naps.state[first // STRIP : (last + STRIP - 1) // STRIP] = AWAKE


@inner
def walk_blocks(first_block, last_block, pixels, light, lut, naps, planes, flags, num, iv, work, out, n, tally):
    """Advance blocks by one interval; returns (keys, their number).

    Flagged pixels are gathered over as many blocks as fill the lanes, so that the vector code has something to do.
    """
    stride = stride_of(flags)
    scratch, flagged, hits = work.scratch, work.flagged, work.hits
    keys, chance = np.empty(128, np.int64), np.empty(128, np.float64)
    used, shots, forced = np.int64(0), np.int64(0), np.int64(0)
    for index in range(first_block, last_block):
        p0 = index * BLOCK
        size = min(BLOCK, pixels - p0)
        if index + 1 < last_block:
            announce(planes.fast, (index + 1) * stride, stride)
        block = planes.fast[index * stride : (index + 1) * stride]
        rest = planes.rest[2 * PITCH * index : 2 * PITCH * (index + 1)]
        if len(flags.forced):
            keys, chance, forced = candidates(keys, chance, p0, size, planes.hot, num, iv)
        asleep = open_eyes(block, scratch, light, lut, planes, p0, size, naps, flags, num, iv, tally)
        if asleep * STRIP >= size and forced == 0:
            continue
        if asleep > 0 or size < BLOCK:
            flagged[:] = 0
        look(block, rest, work, p0, size, naps, flags, num, iv)
        borrowed = np.int64(0)
        if asleep > 0 and forced > 0:
            borrowed = stir(block, scratch, work.lent, p0, keys, forced, planes.theta, naps, flags, num, iv)
        if len(flags.forced):
            if shots > LANE_COUNT // 2:
                out, n = fire(work, shots, planes, flags, num, iv, out, n, tally)
                shots = np.int64(0)
            forced, shots = take_forced(block, work, keys, chance, forced, p0, shots, planes, flags, num, iv)
        count = hits_of(flagged, hits)
        some_general = len(flags.forced) + len(flags.noise) + len(flags.no_closed_form)
        if some_general and (forced > 0 or all_general(flags, iv)):  # (in this order: without it is not compiled)
            count, out, n = take_general(
                block, work, count, p0, keys, chance, forced, planes, flags, num, iv, out, n, tally
            )
        first = np.int64(0)
        while first < count:
            if used == LANE_COUNT:
                out, n = climb(work, used, planes, flags, num, iv, out, n, tally)
                used = np.int64(0)
            some = min(count - first, LANE_COUNT - used)
            for k in range(first, first + some):  # (what `climb` asks for is then there)
                prefetch(planes.memory, p0 + np.int64(hits[k]))
            load(block, scratch, work.lanes[used:], work.pixels[used:], hits[first:], some, p0, flags)
            first, used = first + some, used + some
        keep(block, scratch, p0, size, naps, flags)
        give_back(block, scratch, work.lent, borrowed, flags)
    out, n = climb(work, used, planes, flags, num, iv, out, n, tally)
    if len(flags.forced):
        out, n = fire(work, shots, planes, flags, num, iv, out, n, tally)
    return out, n


@inner
def announce(plane, first, count):
    """Begin to bring float32 entries to the cache, every fourth line: then the machine goes on by itself, which it does
    not where a page ends."""
    for at in range(first, first + count, AHEAD):
        prefetch(plane, np.int64(at))


@inner
def open_eyes(block, scratch, light, lut, planes, p0, size, naps, flags, num, iv, tally):
    """Light of what is awake of a block into the scratch; returns how many of its strips sleep."""
    told, asleep = naps.wanted and naps.told.size > 0, 0
    if not told:
        read_light(scratch, light, lut, planes.shade, p0, size, tally)
    if naps.wanted and len(flags.noise) == 0:
        asleep = doze(block, scratch, p0, size, planes.theta, naps, flags, num, iv)
    if told and asleep == 0:
        read_light(scratch, light, lut, planes.shade, p0, size, tally)
    elif told:
        first, last = 0, 0
        while last < size:
            first, last = next_run(last, p0, size, True, naps.state)
            read_light(scratch[first:], light, lut, planes.shade, p0 + first, last - first, tally)
    return asleep


@inner
def look(block, rest, work, p0, size, naps, flags, num, iv):
    """Scan what is awake of a block, of which the light is in the scratch."""
    scratch, flagged = work.scratch, work.flagged
    forget_rests(scratch)
    first, last, steep = 0, 0, np.int32(0)
    while last < size:
        first, last = next_run(last, p0, size, naps.wanted, naps.state)
        own, part, n = block[first:], scratch[first:], last - first
        steep += scan(own, rest[first:], part, flagged[first:], p0 + first, n, flags, num, iv)
    note_rests(scratch, steep)


@inner
def keep(block, scratch, p0, size, naps, flags):
    """Commit what is awake of a block."""
    first, last = 0, 0
    while last < size:
        first, last = next_run(last, p0, size, naps.wanted, naps.state)
        commit(block[first:], scratch[first:], last - first, flags)


@inner
def take_forced(block, work, keys, chance, forced, p0, shots, planes, flags, num, iv):
    """Load the shots of a block, flag the pixels of other forced events: (candidates left, shots)."""
    forced = keep_likely(block, work.scratch, keys, chance, forced, flags, num, iv)
    for j in range(forced):
        prefetch(planes.memory, p0 + place_of_candidate(keys[j], iv)[0])
    if len(flags.track) > 0 or all_general(flags, iv):
        for j in range(forced):
            work.flagged[place_of_candidate(keys[j], iv)[0]] = 1
        return forced, shots
    return aim(
        block, work.scratch, work.flagged, keys, chance, forced, p0, work.shot_lanes, work.shot_pixels, shots, planes,
        flags, num, iv,
    )  # fmt: skip


@inner
def all_general(flags, iv):
    """Whether all flagged pixels take the general path in this interval."""
    if len(flags.no_closed_form):
        return True
    return len(flags.noise) > 0 and not iv.noise_resolved


@inner
def fire(work, shots, planes, flags, num, iv, out, n, tally):
    """Send the loaded shots: (out, n)."""
    for k in range(shots):
        work.live[k] = k
    return cross(work.shot_lanes, work.shot_pixels, work.live, shots, planes, flags, num, iv, out, n, tally)


@inner
def take_general(block, work, count, p0, keys, chance, forced, planes, flags, num, iv, out, n, tally):
    """Walk the flagged pixels that need the general path; the others stay in `hits`: (how many, out, n)."""
    hits, left, j, every = work.hits, np.int64(0), 0, all_general(flags, iv)
    for k in range(count):
        i = np.int64(hits[k])
        while j < forced and place_of_candidate(keys[j], iv)[0] < i:
            j += 1
        if every or (j < forced and place_of_candidate(keys[j], iv)[0] == i):
            out, n = walk_pixel(
                block, work.scratch, i, p0, work.one_lane, work.one_pixel, keys, chance, forced, work.knots, j, planes,
                flags, num, iv, out, n, tally,
            )  # fmt: skip
        else:
            hits[left] = i
            left += 1
    return left, out, n


@compiled
def settle_tile(first_block, last_block, pixels, light, lut, t_ns, bad, random_phase, planes, flags, num, work, tally):
    """The state after a long time in this light: no lags, levels about the signal."""
    stride, scratch = stride_of(flags), work.scratch
    for index in range(first_block, last_block):
        p0 = index * BLOCK
        size = min(BLOCK, pixels - p0)
        block = planes.fast[index * stride : (index + 1) * stride]
        for i in range(block.size):
            block[i] = 0.0
        block[HIGH * PITCH : HIGH * PITCH + BLOCK] = np.inf
        block[LOW * PITCH : LOW * PITCH + BLOCK] = -np.inf
        read_light(scratch, light, lut, planes.shade, p0, size, tally)
        for first in range(0, size, LANE_COUNT):
            seen = scratch[NEW + first : NEW + min(first + LANE_COUNT, size)]
            settle_lanes(block, seen, first, seen.size, p0, t_ns, bad, random_phase, planes, flags, num, work)
